//! Links and joints.

use std::collections::HashMap;

use formats::plausible::Warning;
use glam::{DAffine3, DVec3};
use roxmltree::Node;

use super::element::{attribute, child, fault, numbers, origin, required, within};
use crate::ParseError;
use crate::import::Import;

pub struct Joint<'a> {
    pub name: &'a str,
    node: Node<'a, 'a>,
    kind: &'a str,
    /// The indices of the parent and of the child.
    pub links: (usize, usize),
}

impl<'a> Joint<'a> {
    fn new(node: Node<'a, 'a>, links: &HashMap<&str, usize>) -> Result<Self, ParseError> {
        let name = attribute(node, "name")?;
        let read = || {
            let kind = attribute(node, "type")?;
            let known = ["revolute", "continuous", "prismatic", "fixed", "floating", "planar"];
            if !known.contains(&kind) {
                let known = known.join(", ");
                return Err(fault(
                    node,
                    format!("expected one of {known} as type, found {kind:?}"),
                ));
            }
            let link = |which: &str| {
                let end = required(node, which)?;
                let link = attribute(end, "link")?;
                let missing = || fault(end, format!("expected a link as {which}, found {link:?}"));
                links.get(link).copied().ok_or_else(missing)
            };
            Ok(Self { name, node, kind, links: (link("parent")?, link("child")?) })
        };
        read().map_err(|error| within("joint", name, error))
    }

    fn moves(&self) -> bool {
        ["revolute", "continuous", "prismatic"].contains(&self.kind)
    }

    /// From the child to the parent.
    pub fn at(&self, position: f64) -> Result<DAffine3, ParseError> {
        let read = || {
            let origin = origin(self.node)?;
            if !self.moves() {
                return Ok(origin);
            }
            let axis = child(self.node, "axis").map(|axis| numbers(axis, "xyz")).transpose()?;
            let axis = DVec3::from_array(axis.flatten().unwrap_or([1.0, 0.0, 0.0]));
            let axis = axis.try_normalize().ok_or_else(|| {
                fault(self.node, "expected an axis of a length above 0, found 0".to_owned())
            })?;
            Ok(origin
                * match self.kind {
                    "prismatic" => DAffine3::from_translation(position * axis),
                    _ => DAffine3::from_axis_angle(axis, position),
                })
        };
        read().map_err(|error| within("joint", self.name, error))
    }

    /// What is probably wrong with this position.
    fn warning(&self, position: f64) -> Result<Option<Warning>, ParseError> {
        let (name, kind) = (self.name, self.kind);
        if ["floating", "planar"].contains(&kind) {
            let (name, kind) = (name.to_owned(), kind.to_owned());
            return Ok(Some(Warning::JointStays { name, kind }));
        }
        let limit = child(self.node, "limit").filter(|_| kind != "continuous" && self.moves());
        let Some(limit) = limit else { return Ok(None) };
        let end = |end: &str| {
            let found = numbers(limit, end).map_err(|error| within("joint", name, error))?;
            Ok::<_, ParseError>(found.map(|[end]| end))
        };
        let (lower, upper) = (end("lower")?, end("upper")?);
        let is_outside = lower.is_some_and(|lower| position < lower)
            || upper.is_some_and(|upper| position > upper);
        let limits = [lower, upper].map(Option::unwrap_or_default);
        let (name, found) = (name.to_owned(), position);
        Ok(is_outside.then_some(Warning::JointBeyondLimits { name, limits, found }))
    }
}

/// The links and joints of a robot; each link but the root has one joint above.
pub struct Robot<'a> {
    node: Node<'a, 'a>,
    pub links: Vec<(&'a str, Node<'a, 'a>)>,
    pub root: usize,
    pub joints: Vec<Joint<'a>>,
    /// The joints below each link.
    pub below: Vec<Vec<usize>>,
}

impl<'a> Robot<'a> {
    pub fn new(node: Node<'a, 'a>) -> Result<Self, ParseError> {
        let (mut links, mut numbers) = (Vec::new(), HashMap::new());
        for link in node.children().filter(|node| node.has_tag_name("link")) {
            let name = attribute(link, "name")?;
            if numbers.insert(name, links.len()).is_some() {
                let cause = format!("expected links of different names, found two {name:?}");
                return Err(fault(link, cause));
            }
            links.push((name, link));
        }
        let joints = node.children().filter(|node| node.has_tag_name("joint"));
        let joints: Vec<_> =
            joints.map(|joint| Joint::new(joint, &numbers)).collect::<Result<_, _>>()?;
        let mut below = vec![Vec::new(); links.len()];
        let mut above = vec![None; links.len()];
        for (i, joint) in joints.iter().enumerate() {
            let (parent, child) = joint.links;
            if let Some(other) = above[child].replace(joint.name) {
                let cause =
                    format!("expected one joint above, found {other:?} and {:?}", joint.name);
                return Err(within("link", links[child].0, fault(joint.node, cause)));
            }
            below[parent].push(i);
        }
        let roots: Vec<usize> = (0..links.len()).filter(|i| above[*i].is_none()).collect();
        let [root] = roots[..] else {
            let found: Vec<_> = roots.iter().take(2).map(|i| links[*i].0).collect();
            let found = if found.is_empty() { "none".to_owned() } else { found.join(" and ") };
            let cause = format!("expected one link without a joint above, found {found}");
            return Err(fault(node, cause));
        };
        Ok(Self { node, links, root, joints, below })
    }

    /// The positions of all joints.
    pub fn positions(
        &self,
        import: &Import,
        warnings: &mut Vec<Warning>,
    ) -> Result<Vec<f64>, ParseError> {
        let by_name: HashMap<&str, &Joint> =
            self.joints.iter().map(|joint| (joint.name, joint)).collect();
        if by_name.len() < self.joints.len() {
            let cause = "expected joints of different names, found two of one name";
            return Err(fault(self.node, cause.to_owned()));
        }
        for (name, position) in &import.joints {
            let cause = match by_name.get(name.as_str()) {
                None => {
                    let known = self.joints.iter().filter(|joint| joint.moves());
                    let known: Vec<_> = known.map(|joint| joint.name).collect();
                    format!("expected one of {}, found none", known.join(", "))
                }
                Some(joint) if !joint.moves() => {
                    format!("expected a joint that moves, found type {:?}", joint.kind)
                }
                Some(joint) if child(joint.node, "mimic").is_some() => {
                    "expected a joint that follows no other, found a mimic".to_owned()
                }
                Some(_) if !position.is_finite() => {
                    format!("expected a finite position, found {position}")
                }
                Some(_) => continue,
            };
            return Err(within("joint", name, fault(self.node, cause)));
        }
        let position = |joint| {
            let position = self.position(joint, &by_name, import);
            let position = position.map_err(|error| within("joint", joint.name, error))?;
            warnings.extend(joint.warning(position)?);
            Ok(position)
        };
        self.joints.iter().map(position).collect()
    }

    /// The position of a joint: its own, or what it makes of that of the joint which it follows.
    fn position(
        &self,
        joint: &Joint<'a>,
        by_name: &HashMap<&str, &Joint<'a>>,
        import: &Import,
    ) -> Result<f64, ParseError> {
        const MOST_FOLLOWED: usize = 100;
        let (mut at, mut factor, mut offset) = (joint, 1.0, 0.0);
        for _ in 0..MOST_FOLLOWED {
            let Some(mimic) = child(at.node, "mimic") else {
                let own = import.joints.get(at.name).copied().unwrap_or_default();
                return Ok(factor * own + offset);
            };
            let of = attribute(mimic, "joint")?;
            let missing = || fault(mimic, format!("mimic: expected a joint, found {of:?}"));
            at = by_name.get(of).copied().ok_or_else(missing)?;
            let [by] = numbers(mimic, "multiplier")?.unwrap_or([1.0]);
            let [and] = numbers(mimic, "offset")?.unwrap_or([0.0]);
            (offset, factor) = (factor * and + offset, factor * by);
        }
        let cause = format!("expected it to follow up to {MOST_FOLLOWED} joints, found a circle");
        Err(fault(joint.node, cause))
    }
}
