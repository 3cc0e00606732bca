//! The definitions of messages, from the packages common_interfaces, geometry2, rcl_interfaces and
//! vision_msgs (4.x) of ROS 2, without comments.

const SEPARATOR: &str =
    "================================================================================";

/// Each as MCAP has it: the separator, the name, and the fields.
const ALL: &str = include_str!("definitions.msg");

/// The names and the fields of all.
fn definitions() -> impl Iterator<Item = (&'static str, &'static str)> {
    ALL.split(SEPARATOR).filter_map(|part| part.strip_prefix("\nMSG: ")?.split_once('\n'))
}

fn find(name: &str) -> Option<&'static str> {
    definitions().find(|(known, _)| *known == name).map(|(_, text)| text)
}

/// The definition of `name`, then those of the types that it contains, each once.
pub fn with_contents(name: &str) -> String {
    let mut text = find(name).expect("invariant: each message has a definition").to_owned();
    let (mut known, mut next) = (vec![name], 0);
    while let Some(definition) = known.get(next).and_then(|name| find(name)) {
        next += 1;
        for field in definition.lines() {
            // The type stands first, with brackets if it is a sequence.
            let kind = field.split([' ', '[']).next().unwrap_or_default();
            if let Some(definition) = find(kind).filter(|_| !known.contains(&kind)) {
                known.push(kind);
                text += &format!("{SEPARATOR}\nMSG: {kind}\n{definition}");
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_definition_is_followed_by_those_it_names_each_once() {
        let text = with_contents("tf2_msgs/TFMessage");
        let parts: Vec<_> = text.split(&format!("{SEPARATOR}\n")).collect();
        let first_lines: Vec<_> = parts.iter().map(|part| part.lines().next().unwrap()).collect();
        let expected = [
            "geometry_msgs/TransformStamped[] transforms",
            "MSG: geometry_msgs/TransformStamped",
            "MSG: std_msgs/Header",
            "MSG: geometry_msgs/Transform",
            "MSG: builtin_interfaces/Time",
            "MSG: geometry_msgs/Vector3",
            "MSG: geometry_msgs/Quaternion",
        ];
        assert_eq!(first_lines, expected);
    }

    #[test]
    fn all_types_that_definitions_name_are_defined() {
        assert_eq!(definitions().count(), 24);
        for (name, text) in definitions() {
            let kinds = text.lines().map(|line| line.split([' ', '[']).next().unwrap());
            for kind in kinds.filter(|kind| kind.contains('/')) {
                assert!(find(kind).is_some(), "{name}: {kind}");
            }
        }
    }
}
