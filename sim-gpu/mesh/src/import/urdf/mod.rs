//! Robots in URDF, whose joints stand at given positions.

mod element;
mod geometry;
mod robot;
#[cfg(test)]
mod tests;

use std::path::Path;

use formats::plausible::foreign;
use glam::DAffine3;
use roxmltree::{Document, Node};

use super::Import;
use crate::file::read;
use crate::{Assembly, Malformed, MeshError, ParseError};
use element::{fault, within};
use geometry::Builder;
use robot::Robot;

/// Reads the robot at `path`, and the meshes that it names.
pub(crate) fn load(
    path: &Path,
    import: &Import,
    world_from_file: DAffine3,
) -> Result<Assembly, MeshError> {
    let bytes = read(path)?;
    let no_text = |_| ParseError::from(Malformed::Syntax("expected URDF, found no UTF-8".into()));
    let parsed = std::str::from_utf8(&bytes)
        .map_err(no_text)
        .and_then(|text| parse(text, Some(path), import, world_from_file));
    parsed.map_err(|error| match foreign(&bytes) {
        _ if bytes.is_empty() => ParseError::from(Malformed::Empty).of(path),
        Some(found) => {
            ParseError::from(Malformed::Syntax(format!("expected URDF, found {found}"))).of(path)
        }
        None => error.of(path),
    })
}

/// The robot of this text; without its path, it has no files of meshes.
pub fn parse(
    text: &str,
    path: Option<&Path>,
    import: &Import,
    world_from_file: DAffine3,
) -> Result<Assembly, ParseError> {
    let document = Document::parse(text.trim_start_matches('\u{FEFF}')).map_err(|error| {
        let cause = format!("expected URDF, which is XML: {error}");
        Malformed::Syntax(cause).at(error.pos().row as usize)
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        let found = root.tag_name().name();
        return Err(fault(root, format!("expected the element robot, found {found}")));
    }
    let is_xacro = |node: &Node<'_, '_>| {
        node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
    };
    if let Some(node) = root.descendants().find(is_xacro) {
        let name = node.tag_name().name();
        let cause = format!("expected URDF, found xacro:{name}: run `xacro` on the file first");
        return Err(fault(node, cause));
    }
    let robot = Robot::new(root)?;
    let mut builder = Builder::of(path);
    let positions = robot.positions(import, &mut builder.assembly.warnings)?;
    let mut open = vec![(robot.root, world_from_file)];
    let mut n_reached = 0;
    while let Some((number, world_from_link)) = open.pop() {
        n_reached += 1;
        let (name, link) = robot.links[number];
        builder
            .add_link(link, name, import.collision, world_from_link)
            .map_err(|error| within("link", name, error))?;
        for &number in robot.below[number].iter().rev() {
            let joint = &robot.joints[number];
            let link_from_child = joint.at(positions[number])?;
            open.push((joint.links.1, world_from_link * link_from_child));
        }
    }
    if n_reached < robot.links.len() {
        let cause = "expected joints from one root to each link, found a circle of links";
        return Err(fault(root, cause.to_owned()));
    }
    if builder.assembly.parts.is_empty() {
        let [kind, other] = match import.collision {
            true => ["collision", "visual"],
            false => ["visual", "collision"],
        };
        let found = match root.descendants().any(|node| node.has_tag_name(other)) {
            true => format!("only {other} geometry: `collision = {}` takes it", !import.collision),
            false => "none".to_owned(),
        };
        return Err(fault(root, format!("expected a link with {kind} geometry, found {found}")));
    }
    Ok(builder.assembly)
}
