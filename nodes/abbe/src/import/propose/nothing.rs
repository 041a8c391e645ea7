//! Why nothing is read of a table.

use super::super::recognise::{Recognised, Role};
use super::super::{deviation_names, pass_names, unread};
use super::{names, sign};

/// The cells that stand in the way; without any, what is unsure about the names of columns.
pub fn in_words(found: &Recognised) -> String {
    // Names that stand for columns say nothing of them.
    if found.head_line == 0 {
        return format!(
            "no line of names: write a map that names the columns {} (docs/reference/scenario.md#import-map); `period_ms` of a log turns sample \
             numbers into times",
            names(found).join(", ")
        );
    }
    unread::in_words(found).unwrap_or_else(|| {
        format!(
            "{}{}{}{}columns {}: neither targets with deviations, nor a time with a displacement, nor angles with radial deviations, nor x, y and z of touches: write a map (docs/reference/scenario.md#import-map)",
            pass_names::unsure(found),
            sign::unsure(found),
            deviation_names::unsure(found),
            without_places(found),
            names(found).join(", ")
        )
    })
}

/// What readings lack that have no column beside them of where or when they were made, as those of a dial in a list; empty without
/// such readings.
fn without_places(found: &Recognised) -> String {
    let is_place = |role: &Role| matches!(role, Role::Target | Role::Time | Role::Angle);
    let roles = || found.columns.iter().filter_map(|column| column.role);
    let is_reading = |role: &Role| {
        let of_gauges = [
            Role::Deviation,
            Role::Displacement,
            Role::Measured,
            Role::Radial,
        ];
        of_gauges.contains(role) || matches!(role, Role::Pass(_))
    };
    let is_unsure = !pass_names::unsure(found).is_empty();
    let is_read = is_unsure || roles().any(|role| is_reading(&role));
    if roles().any(|role| is_place(&role)) || !is_read {
        return String::new();
    }
    "readings without positions, times or angles: add a column of where or when each was made (target_mm, time_s or angle_deg); ".to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::of;

    /// Why a list of readings is refused.
    fn refusal(name: &str, text: &str) -> String {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join(name);
        std::fs::write(&path, text).expect("a file");
        let refused = of(&path).expect_err(text);
        format!("{refused:#}")
    }

    #[test]
    fn readings_of_a_dial_without_positions_are_refused_with_the_column_that_they_lack() {
        for text in [
            "dial um\n0\n1\n2\n3\n2\n1\n",
            "up,down\n0,1\n1,2\n2,3\n3,4\n",
            "direction,reading um\nup,1\ndown,2\nup,1.5\ndown,2.5\n",
            "run,dial gauge um\n1,1\n2,2\n3,3\n",
            "no,reading up um,reading down um\n1,1,2\n2,2,3\n3,3,4\n",
            "0.001\n0.002\n0.003\n0.002\n",
            "0,001\n0,002\n0,003\n0,002\n",
            "Messung;Anzeige mm\n1;0,01\n2;0,02\n3;0,015\n",
            "Point,Dial (um)\nP1,3\nP2,4\nP3,5\n",
            "reading 1 um,reading 2 um\n3,4\n5,6\n7,8\n",
        ] {
            let said = refusal("a.csv", text);
            let words = ["target_mm", "time_s", "angle_deg"];
            assert!(
                words.iter().all(|word| said.contains(word)),
                "{text}: {said}"
            );
            assert!(said.contains("a column of"), "{text}: {said}");
        }
        let other = refusal("a.csv", "colour,weight\n1,2\n3,4\n");
        assert!(!other.contains("target_mm"), "{other}");
    }
}
