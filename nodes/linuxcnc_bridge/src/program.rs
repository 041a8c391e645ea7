//! What the bridge knows of a program's text: its length and which feature each line touches.

/// A program that was handed over.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProgramText {
    lines: u32,
    features: Vec<(u32, String)>,
}

impl ProgramText {
    /// Reads the `(feature: NAME)` comments of a program.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut program = Self::default();
        for line in text.lines() {
            program.lines = program.lines.saturating_add(1);
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
    fn broken_comments_name_nothing() {
        let program = ProgramText::new("(feature: open\n)feature: x(\n(feature)\n(: a)");
        assert_eq!(program.feature_at(4), "");
    }
}
