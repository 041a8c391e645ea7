//! What the bridge knows of a program's text: its frame and length, which feature each line touches, where it may
//! stop, and which words would shift the machine's coordinates.

use machine::program_frame::{is_machine_frame, misplaced_frame};
use metrology::bound::NAME_BYTES;

use crate::waiting::Stops;
use crate::watch::{plain_words, tenths};

/// A program that was handed over.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProgramText {
    lines: u32,
    features: Vec<(u32, String)>,
    stops: Stops,
    is_machine_frame: bool,
    misplaced_frame: Option<u32>,
    touches: bool,
    shifting: Option<(u32, ShiftingWord)>,
}

/// A word that shifts, turns or scales coordinates: its number in tenths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShiftingWord(u32);

/// G10, G41 to G43.2, G52, G54 to G59.3, G92 to G92.3.
const SHIFTING: [u32; 22] = [
    100, 410, 411, 420, 421, 430, 431, 432, 520, 540, 550, 560, 570, 580, 590, 591, 592, 593, 920,
    921, 922, 923,
];

impl std::fmt::Display for ShiftingWord {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "G{}", f64::from(self.0) / 10.0)
    }
}

fn shifting_word(line: &str) -> Option<ShiftingWord> {
    let upper = line.to_ascii_uppercase();
    { plain_words(&upper)?.into_iter() }.find_map(|(letter, value)| {
        let code = tenths(value).filter(|code| letter == "G" && SHIFTING.contains(code))?;
        Some(ShiftingWord(code))
    })
}

impl ProgramText {
    /// Reads the `(feature: NAME)` comments of a program.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut program = Self {
            is_machine_frame: is_machine_frame(text),
            misplaced_frame: misplaced_frame(text),
            ..Self::default()
        };
        for line in text.lines() {
            program.lines = program.lines.saturating_add(1);
            program.stops.line(program.lines, line);
            program.touches |= touches(line);
            if program.shifting.is_none() {
                program.shifting = shifting_word(line).map(|word| (program.lines, word));
            }
            if let Some(name) = feature_comment(line) {
                program.features.push((program.lines, name.to_owned()));
            }
        }
        program
    }

    /// Number of lines.
    #[must_use]
    pub fn lines(&self) -> u32 {
        self.lines
    }

    /// Where it may stop.
    #[must_use]
    pub fn stops(&self) -> &Stops {
        &self.stops
    }

    /// Whether its coordinates are the machine's.
    #[must_use]
    pub fn is_machine_frame(&self) -> bool {
        self.is_machine_frame
    }

    /// Line of the first comment of the frame that does not count, by its place or its text.
    #[must_use]
    pub fn misplaced_frame(&self) -> Option<u32> {
        self.misplaced_frame
    }

    /// The first feature whose name is longer than a message may have it: line and bytes.
    #[must_use]
    pub fn long_name(&self) -> Option<(u32, usize)> {
        let mut lengths = self.features.iter().map(|(line, name)| (*line, name.len()));
        lengths.find(|(_, bytes)| *bytes > NAME_BYTES)
    }

    /// Whether a line of it touches; a file that it calls is not looked into.
    #[must_use]
    pub fn touches(&self) -> bool {
        self.touches
    }

    /// The first word that would shift the coordinates of a program of the machine frame, and its line.
    #[must_use]
    pub fn breaks_frame(&self) -> Option<(u32, ShiftingWord)> {
        self.shifting.filter(|_| self.is_machine_frame)
    }

    /// Name in the last feature comment at or before `line` (from 1); empty where there is none.
    #[must_use]
    pub fn feature_at(&self, line: u32) -> &str {
        let count = self
            .features
            .partition_point(|(comment_line, _)| *comment_line <= line);
        count
            .checked_sub(1)
            .map_or("", |last| self.features[last].1.as_str())
    }

    /// Share of the lines up to `line`, 0 to 1.
    #[must_use]
    pub fn progress_at(&self, line: u32) -> f64 {
        if self.lines == 0 {
            0.0
        } else {
            f64::from(line.min(self.lines)) / f64::from(self.lines)
        }
    }
}

/// Whether a line has G38.2 to G38.5 outside comments, among whatever else.
fn touches(line: &str) -> bool {
    let mut words = String::new();
    let mut in_comment = false;
    for character in line.chars() {
        match character {
            '(' => in_comment = true,
            ')' => in_comment = false,
            ';' if !in_comment => break,
            _ if in_comment || character.is_whitespace() => {}
            _ => words.push(character.to_ascii_uppercase()),
        }
    }
    words.split('G').skip(1).any(|behind| {
        let number = behind.trim_start_matches('0');
        number.starts_with("38.")
    })
}

/// Name in the last feature comment of one line.
fn feature_comment(line: &str) -> Option<&str> {
    let comments = line
        .split('(')
        .skip(1)
        .filter_map(|tail| tail.split_once(')'));
    comments
        .filter_map(|(comment, _)| {
            let (key, name) = comment.split_once(':')?;
            key.trim()
                .eq_ignore_ascii_case("feature")
                .then(|| name.trim())
        })
        .last()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_comment_that_does_not_count_is_refused_with_its_line() {
        for (text, wanted) in [
            (";(frame: machine)\nG0 X1\nM2\n", Some(1)),
            ("G21 ; part (frame: machin)\nM2\n", Some(1)),
            ("(frame: machin)\nG0 X1\nM2\n", Some(1)),
            ("G21\n(frame: machine)\nG0 X1\nM2\n", Some(2)),
            ("(frame: machine) ; part\nM2\n", None),
            ("; part 7\nM2\n", None),
        ] {
            let found = ProgramText::new(text).misplaced_frame();
            assert_eq!(found, wanted, "{text:?}");
        }
        let words = crate::run::Refusal::FrameComment(2).to_string();
        assert!(
            words.starts_with("line 2: ") && words.contains("in parentheses, on line 1"),
            "{words}"
        );
    }

    #[test]
    fn the_last_comment_before_the_line_names_the_feature() {
        let text = "G21\n(feature: block_1/x)\nG38.2 X1 F60\nG0 X0 (Feature: block_1/y ) (done)\n";
        let program = ProgramText::new(text);
        assert_eq!(program.lines(), 4);
        assert_eq!(program.feature_at(1), "");
        assert_eq!(program.feature_at(3), "block_1/x");
        assert_eq!(program.feature_at(4), "block_1/y");
        assert_eq!(program.feature_at(u32::MAX), "block_1/y");
    }

    #[test]
    fn a_program_of_the_machine_frame_may_not_shift_it() {
        let head = machine::program_frame::HEAD;
        assert_eq!(
            ProgramText::new(&format!("{head}G0 X1\nM2\n")).breaks_frame(),
            None
        );
        for word in [
            "G54",
            "g 59.3",
            "G92 X0",
            "G52 X1",
            "G10 L2 P1 X0",
            "G43 H1",
            "N7G41D1",
            "G92.1",
        ] {
            let (line, told) = ProgramText::new(&format!("{head}G0 X1 (G54)\n{word}\nM2\n"))
                .breaks_frame()
                .unwrap();
            assert_eq!(line, 4, "{word}");
            assert!(
                word.to_uppercase()
                    .replace(' ', "")
                    .contains(&told.to_string()),
                "{told}"
            );
            let own = ProgramText::new(&format!("G21\n{word}\nM2\n"));
            assert_eq!(own.breaks_frame(), None, "{word}");
        }
    }

    #[test]
    fn programs_that_touch_are_known() {
        for line in [
            "G38.2 Z-5 F60",
            "n10g 38.3z0",
            "G91G038.4X[#1+2]",
            "o1 if [#2] G38.5 X1",
        ] {
            assert!(
                ProgramText::new(&format!("G21\n{line}\nM2\n")).touches(),
                "{line}"
            );
        }
        for line in [
            "G1 X38.2 F60",
            "(G38.2 Z0)",
            "G0 X1 ; G38.2 Z0",
            "G3 X8.2 Y0 I1",
            "G380",
        ] {
            assert!(
                !ProgramText::new(&format!("G21\n{line}\nM2\n")).touches(),
                "{line}"
            );
        }
    }

    #[test]
    fn a_name_of_a_feature_that_no_message_may_have_is_found() {
        for (name, found) in [
            ("a".repeat(255), None),
            ("a".repeat(256), Some((2, 256))),
            ("ä".repeat(128), Some((2, 256))),
            ("b".repeat(9_000), Some((2, 9_000))),
        ] {
            let text = format!("G21 (feature: x)\n(Feature: {name} )\nG38.2 Z0\n");
            assert_eq!(ProgramText::new(&text).long_name(), found);
        }
    }

    #[test]
    fn broken_comments_name_nothing() {
        let program = ProgramText::new("(feature: open\n)feature: x(\n(feature)\n(: a)");
        assert_eq!(program.feature_at(4), "");
    }
}
