//! `ROS_DISTRO`: which definitions of ROS 2's own messages the graph uses.

use abbe_msgs::Release;

use super::Environment;

/// Distributions with the definitions of Jazzy; of those before Jazzy nothing was tried.
const OLDER: [&str; 11] = [
    "ardent", "bouncy", "crystal", "dashing", "eloquent", "foxy", "galactic", "humble", "iron",
    "jazzy", "kilted",
];
/// Distributions with the definitions of Lyrical.
const NEWER: [&str; 2] = ["lyrical", "rolling"];

/// The definitions of a distribution, of Jazzy where none is named; `None`: the name is not known.
pub(crate) fn release(distribution: Option<&str>) -> Option<Release> {
    match distribution {
        None => Some(Release::Jazzy),
        Some(name) if OLDER.contains(&name) => Some(Release::Jazzy),
        Some(name) if NEWER.contains(&name) => Some(Release::Lyrical),
        Some(_) => None,
    }
}

impl Environment {
    /// What to warn of where `ROS_DISTRO` is no name that is known.
    #[must_use]
    pub fn distribution_warning(&self) -> Option<String> {
        /// Letters of a name that are shown.
        const SHOWN: usize = 64;
        let name = self.unknown_distribution.as_ref()?;
        let cut = name.char_indices().nth(SHOWN).map(|(at, _)| at);
        let name = cut.map_or_else(|| name.clone(), |at| format!("{}…", &name[..at]));
        Some(format!(
            "ROS_DISTRO={name}: unknown, taken as newer than lyrical: lifecycle_msgs/TransitionEvent has Lyrical's definition; \
             set ROS_DISTRO=jazzy for that of Jazzy"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(distribution: &str) -> Environment {
        let variable = |name: &str| (name == "ROS_DISTRO").then(|| distribution.to_owned());
        Environment::from_variables(variable).unwrap()
    }

    #[test]
    fn definitions_are_those_of_the_named_distribution_and_of_jazzy_without_a_name() {
        for (distribution, release) in [
            ("", Release::Jazzy),
            ("humble", Release::Jazzy),
            ("jazzy", Release::Jazzy),
            ("kilted", Release::Jazzy),
            ("lyrical", Release::Lyrical),
            ("rolling", Release::Lyrical),
        ] {
            let environment = read(distribution);
            assert_eq!(environment.release, release, "{distribution}");
            assert_eq!(environment.distribution_warning(), None, "{distribution}");
        }
    }

    #[test]
    fn an_unknown_distribution_is_taken_as_the_newest_with_a_warning() {
        let environment = read("mystic");
        assert_eq!(environment.release, Release::Lyrical);
        let warning = environment.distribution_warning().unwrap();
        assert!(warning.contains("ROS_DISTRO=mystic: unknown"), "{warning}");
        let long = read(&"ß".repeat(10_000)).distribution_warning().unwrap();
        assert!(long.contains("ß…: unknown") && long.len() < 500, "{long}");
        assert!(warning.contains("TransitionEvent"), "{warning}");
    }
}
