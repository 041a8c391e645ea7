//! Which of the bag's tables were written, and of when.

use std::path::Path;

use clap::ValueEnum;
use metrology::sample::PositioningTable;
use metrology::{Axis, AxisSet, PerAxis};

use super::counting::Counting;

/// Which table of an axis is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Which {
    /// The first of the bag: as it was learned, where the bag holds that.
    First,
    /// The last one, with every refresh.
    #[default]
    Last,
}

/// A table as it was published.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Said {
    log_time_nanos: u64,
    n_runs: u32,
    weight: f64,
    position_mm: Vec<f64>,
    both_mm: [Vec<f64>; 2],
}

impl Said {
    pub fn new(table: &PositioningTable, log_time_nanos: u64) -> Self {
        Self {
            log_time_nanos,
            n_runs: table.n_runs,
            weight: table.weight,
            position_mm: table.position.clone(),
            both_mm: [table.deviation_up.clone(), table.deviation_down.clone()],
        }
    }

    /// Where and by how much another table of the same points differs most, mm.
    fn greatest_change_mm(&self, other: &Self) -> Option<(f64, f64)> {
        let changes = self
            .both_mm
            .iter()
            .zip(&other.both_mm)
            .flat_map(|(from, to)| {
                let pairs = from.iter().zip(to).zip(&self.position_mm);
                pairs.map(|((from, to), position_mm)| (*position_mm, to - from))
            });
        (self.position_mm == other.position_mm)
            .then(|| changes.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())))
            .flatten()
    }
}

/// What a bag said of the table of one axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Tables {
    first: Option<Said>,
    last: Option<Said>,
    n: u64,
}

impl Tables {
    pub fn add(&mut self, said: Said) {
        self.n += 1;
        self.first.get_or_insert_with(|| said.clone());
        self.last = Some(said);
    }
}

/// Models that a bag has.
const MODELS: [&str; 3] = [
    "geometric errors",
    "thermal drift",
    "errors of the rotary axes",
];
/// Places among them.
pub(super) const GEOMETRY: usize = 0;
pub(super) const THERMAL: usize = 1;
pub(super) const ROTARY: usize = 2;

/// Where tables come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Origin {
    /// Log time of the bag's first message, ns.
    pub began_nanos: Option<u64>,
    /// Namespaces of the bag's topics, without the root.
    pub namespaces: Vec<String>,
    /// Of each axis, the first and the last positioning table in the bag, and how many.
    pub tables: PerAxis<Option<Tables>>,
    /// Models of [`MODELS`]: how many, and the log time of the last, ns.
    pub models: [Option<(u64, u64)>; 3],
    /// Axes whose table was made of the stops of a verification.
    pub of_stops: AxisSet,
    /// Of each axis whose table was made of runs of an external reference, what these were.
    pub of_references: PerAxis<Option<String>>,
}

impl Origin {
    fn since_began(&self, nanos: u64) -> String {
        let began_nanos = self.began_nanos.unwrap_or(nanos);
        let s = nanos.saturating_sub(began_nanos) / 1_000_000_000;
        format!("{:02}:{:02}:{:02} h", s / 3600, s / 60 % 60, s % 60)
    }

    /// In words, a line each.
    pub fn lines(&self, bag: &Path, counting: &Counting) -> Vec<String> {
        let mut lines = vec![format!("made of the bag {}", bag.display())];
        if !self.namespaces.is_empty() {
            let namespaces = self.namespaces.join(", ");
            lines.push(format!("namespace of the bag's topics: {namespaces}"));
        }
        for (axis, span) in counting.written() {
            if let Some(said) = &self.of_references[axis] {
                lines.push(said.clone());
            } else if self.of_stops.contains(axis) {
                lines.push(format!(
                    "positioning of {axis}: of the last verification along it with nothing added to its commands (--stops), one run"
                ));
            } else if let Some(tables) = &self.tables[axis] {
                lines.extend(self.of_table(axis, tables, counting.which));
            } else {
                lines.push(format!(
                    "positioning of {axis}: E{axis}{axis} of the geometric errors"
                ));
            }
            lines.push(counting.zero(axis, span));
        }
        for (name, (n, nanos)) in MODELS
            .iter()
            .zip(self.models)
            .filter_map(|(name, model)| Some((name, model?)))
        {
            let when = self.since_began(nanos);
            lines.push(format!(
                "{name}: the last of {n} models of the bag, from {when} after its first message"
            ));
        }
        lines
    }

    /// A model was published.
    pub fn add_model(&mut self, place: usize, log_time_nanos: u64) {
        let (n, at) = self.models[place].get_or_insert_default();
        (*n, *at) = (*n + 1, log_time_nanos);
    }

    fn of_table(&self, axis: Axis, tables: &Tables, which: Which) -> Option<String> {
        let (first, last) = (tables.first.as_ref()?, tables.last.as_ref()?);
        let (said, other, place) = match which {
            Which::First => (first, last, "first"),
            Which::Last => (last, first, "last"),
        };
        let n = tables.n;
        let mut text = format!(
            "positioning of {axis}: the {place} of {n} tables of the bag, from {} after its first message; {} runs, weight {} of a refresh",
            self.since_began(said.log_time_nanos),
            said.n_runs,
            said.weight,
        );
        if n > 1 {
            let when = self.since_began(other.log_time_nanos);
            let named = if which == Which::Last {
                "first"
            } else {
                "last"
            };
            text += &match other.greatest_change_mm(said) {
                Some((position_mm, change_mm)) => format!(
                    "; it differs from the {named} one ({when}, --table {named}) by {:+.1} um at {position_mm:.3} mm at most. \
                     A table that was refreshed is that of the machine's state at that time, as warm as it then was",
                    change_mm * 1e3
                ),
                None => format!("; the {named} one ({when}, --table {named}) has other points"),
            };
        }
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::super::counting::tests::of_x;
    use super::*;
    use metrology::Stamp;

    fn table(end_mm: f64) -> PositioningTable {
        let position: Vec<f64> = (0..5).map(|k| f64::from(k) * 20.0).collect();
        let up = vec![0.0, 0.0, 0.0, 0.0, end_mm];
        PositioningTable {
            at: Stamp::from_nanos(1),
            axis: Axis::X,
            position,
            deviation_down: vec![0.0; 5],
            deviation_up: up,
            n_runs: 10,
            weight: 0.3,
            sequence: 1,
        }
    }

    fn told(which: Which, relative_to_reference: bool) -> String {
        let mut origin = Origin {
            began_nanos: Some(1_000_000_000),
            ..Origin::default()
        };
        origin.add_model(1, 2_000_000_000);
        origin.add_model(1, 3_000_000_000);
        let mut tables = Tables::default();
        for (s, end_mm) in [(61, 0.004), (4_000, 0.017)] {
            tables.add(Said::new(&table(end_mm), s * 1_000_000_000));
        }
        origin.tables[Axis::X] = Some(tables);
        let mut counting = of_x();
        (counting.which, counting.relative_to_reference) = (which, relative_to_reference);
        origin.lines(Path::new("runs/a/bag"), &counting).join("\n")
    }

    #[test]
    fn an_axis_whose_positioning_is_in_no_file_is_not_told() {
        let mut counting = of_x();
        counting.spans = PerAxis::default();
        let lines = Origin::default().lines(Path::new("bag"), &counting);
        assert_eq!(lines, ["made of the bag bag"]);
    }

    #[test]
    fn the_namespaces_of_the_topics_stand_below_the_bag() {
        for (namespaces, line) in [
            (vec!["/mill_3"], "namespace of the bag's topics: /mill_3"),
            (
                vec!["/laser", "/mill_4"],
                "namespace of the bag's topics: /laser, /mill_4",
            ),
        ] {
            let origin = Origin {
                namespaces: namespaces.into_iter().map(str::to_owned).collect(),
                ..Origin::default()
            };
            let lines = origin.lines(Path::new("bag"), &of_x());
            assert_eq!(lines[1], line);
        }
    }

    #[test]
    fn the_table_that_was_taken_is_named_with_its_time_and_what_the_other_one_says() {
        let last = told(Which::Last, true);
        for word in [
            "runs/a/bag",
            "the last of 2 tables",
            "01:06:39 h",
            "10 runs",
            "00:01:00 h",
            "by +13.0 um at 80.000 mm",
            "counted from the error at 0 mm",
            "thermal drift: the last of 2 models of the bag, from 00:00:02 h",
        ] {
            assert!(last.contains(word), "{word}: {last}");
        }
        let first = told(Which::First, false);
        for word in ["the first of 2", "by -13.0 um at 80.000 mm", "--absolute"] {
            assert!(first.contains(word), "{word}: {first}");
        }
    }
}
