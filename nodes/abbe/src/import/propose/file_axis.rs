//! An axis that the name of the file alone states.

use anyhow::Result;
use metrology::Axis;

use super::Text;

impl Text<'_> {
    /// The axis that the table states, or else the name of its file.
    pub(super) fn axis_told(&mut self, stem: &str, is_log: bool) -> Result<Option<Axis>> {
        let own = self.found.axis("", is_log)?;
        self.is_axis_of_file = own.is_none();
        match own {
            Some(axis) => Ok(Some(axis)),
            None => self.found.axis(stem, is_log),
        }
    }

    /// Says which axis was taken, and where it stands.
    pub(super) fn say_axis(&mut self, axis: Axis) {
        self.recognised.push(if self.is_axis_of_file {
            format!(
                "axis {axis}, by the name of the file alone: where another one moved, write a line such as \"Axis: Y\" above the names"
            )
        } else {
            format!("axis {axis}")
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::of;

    /// The lines on the axis of a table of this name.
    fn said(name: &str, text: &str) -> Vec<String> {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join(name);
        std::fs::write(&path, text).expect("a file");
        let proposal = of(&path).expect("a map");
        let all = proposal.recognised.into_iter().chain(proposal.needed);
        all.filter(|line| line.contains("axis")).collect()
    }

    #[test]
    fn an_axis_of_the_files_name_is_said_to_be_of_it() {
        let linear = "target_mm,deviation_um\n0,1\n40,2\n";
        let rotary = "target_deg,deviation_arcsec\n0,1\n40,2\n";
        let log = "time_s,displacement_um\n0,1\n60,2\n";
        for (name, text, begin) in [
            (
                "lead_Y.csv",
                linear,
                "axis Y, by the name of the file alone",
            ),
            ("X.csv", linear, "axis X, by the name of the file alone"),
            ("log X.csv", log, "axis X, by the name of the file alone"),
            (
                "Report B.csv",
                rotary,
                "axis B, by the name of the file alone",
            ),
            // A letter of a rotary axis is none of a table of lengths, and of two letters none counts.
            ("A 2024.csv", linear, "axis = X: which axis moved"),
            ("X_of_Y.csv", linear, "axis = X: which axis moved"),
            ("test_W.csv", linear, "axis = X: which axis moved"),
        ] {
            let lines = said(name, text);
            assert!(
                lines.iter().any(|line| line.starts_with(begin)),
                "{name}: {lines:?}"
            );
        }
        let stated = said("lead_Y.csv", &format!("Axis: Z\n{linear}"));
        assert_eq!(stated, ["axis Z"]);
    }
}
