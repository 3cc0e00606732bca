//! Links and joints.

use std::collections::{BTreeMap, HashMap};

use glam::{DAffine3, DVec3};
use roxmltree::Node;

use super::element::{attribute, child, fault, named, numbers, origin, required, within};
use crate::import::Import;
use crate::mesh::ParseError;

pub struct Joint<'a> {
    pub name: &'a str,
    node: Node<'a, 'a>,
    kind: &'a str,
    /// The indices of the parent and of the child.
    pub links: (usize, usize),
}

impl<'a> Joint<'a> {
    fn new(node: Node<'a, 'a>, links: &HashMap<&str, usize>) -> Result<Self, ParseError> {
        let name = named(node)?;
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

    /// What is doubtful about this position.
    fn doubt(&self, position: f64) -> Result<Option<String>, ParseError> {
        let limit = child(self.node, "limit").filter(|_| self.kind != "continuous" && self.moves());
        let Some(limit) = limit else { return Ok(None) };
        let [lower, upper] = ["lower", "upper"].map(|end| {
            let number = numbers::<1>(limit, end);
            number.map_err(|error| within("joint", self.name, error))
        });
        let (lower, upper) = (lower?.map(|[x]| x), upper?.map(|[x]| x));
        let is_outside = lower.is_some_and(|lower| position < lower)
            || upper.is_some_and(|upper| position > upper);
        Ok(is_outside.then(|| {
            let [lower, upper] = [lower, upper].map(|end| end.unwrap_or(0.0));
            format!(
                "joint {:?}: expected a position from {lower} to {upper}, its limits, found {position}",
                self.name
            )
        }))
    }
}

/// The links and joints of a robot, a tree.
pub struct Robot<'a> {
    node: Node<'a, 'a>,
    pub links: Vec<Node<'a, 'a>>,
    numbers: HashMap<&'a str, usize>,
    joints: Vec<Joint<'a>>,
    /// The joints below each link.
    below: Vec<Vec<usize>>,
}

impl<'a> Robot<'a> {
    pub fn new(node: Node<'a, 'a>) -> Result<Self, ParseError> {
        let links: Vec<_> = node.children().filter(|node| node.has_tag_name("link")).collect();
        let mut numbers = HashMap::new();
        for (i, link) in links.iter().enumerate() {
            if numbers.insert(named(*link)?, i).is_some() {
                let cause =
                    format!("expected links of different names, found two {:?}", named(*link)?);
                return Err(fault(*link, cause));
            }
        }
        let joints = node.children().filter(|node| node.has_tag_name("joint"));
        let joints =
            joints.map(|joint| Joint::new(joint, &numbers)).collect::<Result<Vec<_>, _>>()?;
        let mut below = vec![Vec::new(); links.len()];
        let mut above = vec![None; links.len()];
        for (i, joint) in joints.iter().enumerate() {
            let (parent, child) = joint.links;
            if let Some(other) = above[child].replace(joint.name) {
                let (link, name) = (named(links[child])?, joint.name);
                let cause = format!(
                    "link {link:?}: expected one joint above, found {other:?} and {name:?}"
                );
                return Err(fault(joint.node, cause));
            }
            below[parent].push(i);
        }
        Ok(Self { node, links, numbers, joints, below })
    }

    /// The link that no joint moves.
    pub fn root(&self) -> Result<Node<'a, 'a>, ParseError> {
        let mut is_moved = vec![false; self.links.len()];
        self.joints.iter().for_each(|joint| is_moved[joint.links.1] = true);
        let mut roots = self.links.iter().zip(is_moved).filter(|(_, moved)| !moved);
        match (roots.next(), roots.next()) {
            (Some((root, _)), None) => Ok(*root),
            (Some((a, _)), Some((b, _))) => {
                let (a, b) = (named(*a)?, named(*b)?);
                let cause =
                    format!("expected one link without a joint above, found {a:?} and {b:?}");
                Err(fault(self.node, cause))
            }
            (None, _) => {
                let cause = "expected a link without a joint above, found none";
                Err(fault(self.node, cause.to_owned()))
            }
        }
    }

    pub fn joints_of(&self, link: &str) -> impl DoubleEndedIterator<Item = &Joint<'a>> {
        self.below[self.numbers[link]].iter().map(|joint| &self.joints[*joint])
    }

    /// The positions of all joints by name.
    pub fn positions(
        &self,
        import: &Import,
        warnings: &mut Vec<String>,
    ) -> Result<BTreeMap<&'a str, f64>, ParseError> {
        let by_name: HashMap<&str, &Joint> =
            self.joints.iter().map(|joint| (joint.name, joint)).collect();
        if by_name.len() < self.joints.len() {
            let cause = "expected joints of different names, found two of one name";
            return Err(fault(self.node, cause.to_owned()));
        }
        for (name, position) in &import.joints {
            let wrong = |cause: String| fault(self.node, format!("joint {name:?}: {cause}"));
            let Some(joint) = by_name.get(name.as_str()) else {
                let known = self.joints.iter().filter(|joint| joint.moves());
                let known: Vec<_> = known.map(|joint| joint.name).collect();
                return Err(wrong(format!("expected one of {}, found none", known.join(", "))));
            };
            if !joint.moves() {
                return Err(wrong(format!(
                    "expected a joint that moves, found type {:?}",
                    joint.kind
                )));
            }
            if child(joint.node, "mimic").is_some() {
                return Err(wrong(
                    "expected a joint that follows no other, found a mimic".to_owned(),
                ));
            }
            if !position.is_finite() {
                return Err(wrong(format!("expected a finite position, found {position}")));
            }
        }
        let mut positions = BTreeMap::new();
        for joint in &self.joints {
            let position = self.position(joint, &by_name, import)?;
            warnings.extend(joint.doubt(position)?);
            if ["floating", "planar"].contains(&joint.kind) {
                let (name, kind) = (joint.name, joint.kind);
                warnings.push(format!("joint {name:?}: a {kind} joint stays at its origin"));
            }
            positions.insert(joint.name, position);
        }
        Ok(positions)
    }

    /// The position of a joint: its own, or what it makes of that of the joint which it follows.
    fn position(
        &self,
        joint: &Joint<'a>,
        by_name: &HashMap<&str, &Joint<'a>>,
        import: &Import,
    ) -> Result<f64, ParseError> {
        let (mut at, mut factor, mut offset) = (joint, 1.0, 0.0);
        for _ in 0..self.joints.len() {
            let Some(mimic) = child(at.node, "mimic") else {
                let own = import.joints.get(at.name).copied().unwrap_or_default();
                return Ok(factor * own + offset);
            };
            let read = || {
                let number = |name, otherwise| {
                    numbers(mimic, name).map(|found| found.map_or(otherwise, |[number]| number))
                };
                let of = attribute(mimic, "joint")?;
                let missing = || fault(mimic, format!("mimic: expected a joint, found {of:?}"));
                let of = by_name.get(of).copied().ok_or_else(missing)?;
                Ok::<_, ParseError>((number("multiplier", 1.0)?, number("offset", 0.0)?, of))
            };
            let (by, and, of) = read().map_err(|error| within("joint", at.name, error))?;
            (offset, factor, at) = (factor * and + offset, factor * by, of);
        }
        Err(fault(joint.node, format!("joint {:?}: it follows itself by mimic", joint.name)))
    }
}
