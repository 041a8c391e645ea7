//! LinuxCNC's modal state, from the line of G codes that it prints.
//!
//! A program of the machine frame needs a state of its own ([`Modal::assertion`]). What it found is put back
//! afterwards word by word ([`Modal::restoring`]): the end of a program (M2) and an abort reset some groups to
//! LinuxCNC's defaults and leave others as the program had them, so neither is what was there before.

use std::fmt;

/// A group of G codes of which exactly one is active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named by its codes in the table below")]
pub enum Group {
    Plane,
    Cutter,
    Units,
    Distance,
    FeedMode,
    System,
    Tool,
    Path,
    Arcs,
    Diameter,
    Motion,
}

/// What each group's codes are.
const GROUPS: [(Group, &[&str]); 11] = [
    (
        Group::Plane,
        &["G17", "G18", "G19", "G17.1", "G18.1", "G19.1"],
    ),
    (Group::Cutter, &["G40", "G41", "G41.1", "G42", "G42.1"]),
    (Group::Units, &["G20", "G21"]),
    (Group::Distance, &["G90", "G91"]),
    (Group::FeedMode, &["G93", "G94", "G95"]),
    (Group::System, &SYSTEMS),
    (Group::Tool, &["G43", "G43.1", "G43.2", "G49"]),
    (Group::Path, &["G61", "G61.1", "G64"]),
    (Group::Arcs, &["G90.1", "G91.1"]),
    (Group::Diameter, &["G7", "G8"]),
    (Group::Motion, &["G0", "G1", "G80"]),
];
/// The work systems, in the order of their parameters.
pub const SYSTEMS: [&str; 9] = [
    "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3",
];
/// Active words of a machine-frame program, besides its work system.
const ASSERTED: [&str; 9] = [
    "G21", "G90", "G17", "G40", "G49", "G80", "G94", "G91.1", "G61",
];

/// The active G codes of the groups that matter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Modal {
    words: [&'static str; GROUPS.len()],
}

/// The group of a code and the code as the table has it.
fn known(code: &str) -> Option<(usize, &'static str)> {
    GROUPS.iter().enumerate().find_map(|(place, (_, codes))| {
        let code = codes
            .iter()
            .find(|known| known.eq_ignore_ascii_case(code))?;
        Some((place, *code))
    })
}

impl Modal {
    /// Reads what `get program_codes` answers; `None` where a group is missing. Where a motion is active that
    /// cannot be set by its word alone, the group of motions is empty.
    #[must_use]
    pub fn read(codes: &str) -> Option<Self> {
        let mut words = [""; GROUPS.len()];
        for code in codes.split_ascii_whitespace() {
            if let Some((place, word)) = known(code) {
                words[place] = word;
            }
        }
        let whole = |(word, (group, _)): (&&str, &(Group, _))| {
            !word.is_empty() || matches!(group, Group::Motion | Group::Diameter)
        };
        words
            .iter()
            .zip(&GROUPS)
            .all(whole)
            .then_some(Self { words })
    }

    /// The active word of a group.
    #[must_use]
    pub fn word(&self, group: Group) -> &'static str {
        let place = GROUPS.iter().position(|(known, _)| *known == group);
        place.map_or("", |place| self.words[place])
    }

    /// The block that makes a state of the machine frame of this one, in work system `system`.
    #[must_use]
    pub fn assertion(&self, system: &str) -> String {
        let mut block = format!("{} {system}", ASSERTED.join(" "));
        if self.word(Group::Diameter) == "G7" {
            block.push_str(" G8");
        }
        block
    }

    /// Which words of the assertion are not active.
    #[must_use]
    pub fn missing(&self, system: &str) -> Vec<String> {
        let block = self.assertion(system);
        let absent = |word: &&str| !self.words.contains(word);
        block.split(' ').filter(absent).map(str::to_owned).collect()
    }

    /// The block that makes this state of `now`, but for the tool length, whose values are put back before it;
    /// `None` where nothing is to be done.
    #[must_use]
    pub fn restoring(&self, now: &Self) -> Option<String> {
        let changed = { self.changed(now) }.filter(|(group, _, _)| *group != Group::Tool);
        let words: Vec<&str> = changed.map(|(_, found, _)| found).collect();
        (!words.is_empty()).then(|| words.join(" "))
    }

    /// What is not as it is here, as a person reads it.
    #[must_use]
    pub fn differences(&self, now: &Self) -> Vec<String> {
        { self.changed(now) }
            .map(|(_, found, now)| format!("{found} was found and {now} is left"))
            .collect()
    }

    /// Group, word here and word in `now` where they differ and the one here can be set by its word alone.
    fn changed(&self, now: &Self) -> impl Iterator<Item = (Group, &'static str, &'static str)> {
        // G1 under inverse time feed wants an F of its own.
        let needs_feed = self.word(Group::FeedMode) == "G93";
        let both = self.words.into_iter().zip(now.words);
        GROUPS
            .iter()
            .zip(both)
            .filter_map(move |((group, _), (found, now))| {
                let is_bare = needs_feed && found == "G1";
                let settable = !(found.is_empty() || is_bare);
                (settable && found != now).then_some((*group, found, now))
            })
    }
}

impl fmt::Display for Modal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<&str> = { self.words.into_iter() }
            .filter(|word| !word.is_empty())
            .collect();
        f.write_str(&words.join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const USUAL: &str = "G80 G17 G40 G21 G90 G94 G54 G49 G99 G61 G97 G91.1 G8 G92.2 F0 S0";

    fn of(codes: &str) -> Modal {
        Modal::read(codes).unwrap()
    }

    #[test]
    fn a_recorded_line_is_read_by_groups() {
        let modal = of("G1 G10 G18 G40 G20 G91 G93 G55 G43 G99 G64 G97 G90.1 G8 G92.2 F47 S0");
        assert_eq!(modal.word(Group::System), "G55");
        assert_eq!(modal.word(Group::Distance), "G91");
        assert_eq!(modal.word(Group::Motion), "G1");
        assert_eq!(Modal::read(""), None);
        assert_eq!(
            Modal::read("G80 G17 G40 G21 G94 G54 G49 G61 G91.1"),
            None,
            "no G90 or G91"
        );
        assert_eq!(of(&USUAL.replace("G80", "G38.2")).word(Group::Motion), "");
    }

    #[test]
    fn every_group_that_differs_is_put_back_by_one_word() {
        let usual = of(USUAL);
        assert_eq!(usual.missing("G54"), Vec::<String>::new());
        assert_eq!(usual.restoring(&usual), None);
        for (_, codes) in GROUPS {
            for code in codes {
                let active = USUAL.split(' ').find(|word| codes.contains(word)).unwrap();
                let words: Vec<&str> = USUAL.split(' ').collect();
                let swapped = words
                    .iter()
                    .map(|word| if *word == active { code } else { word });
                let found = of(&swapped.copied().collect::<Vec<_>>().join(" "));
                let differs = *code != active;
                assert_eq!(
                    found.differences(&usual).len(),
                    usize::from(differs),
                    "{code}"
                );
                assert_eq!(found.missing("G54").is_empty(), !differs, "{code}");
                let is_tool = code.starts_with("G43");
                let expected = (differs && !is_tool).then(|| (*code).to_owned());
                assert_eq!(found.restoring(&usual), expected, "{code}");
            }
        }
    }

    #[test]
    fn the_assertion_names_the_contract_and_leaves_the_diameter_mode_of_lathes() {
        let block = of(USUAL).assertion("G57");
        assert_eq!(block, "G21 G90 G17 G40 G49 G80 G94 G91.1 G61 G57");
        assert!(
            of(&USUAL.replace("G8 ", "G7 "))
                .assertion("G54")
                .ends_with(" G8")
        );
        for word in ASSERTED {
            assert!(machine::program_frame::HEAD.contains(word), "{word}");
        }
    }
}
