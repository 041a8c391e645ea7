//! Readings at one end of the range of an instrument: many targets share the extreme deviation to the last digit, and no other
//! value comes nearly as often.

use std::collections::{BTreeMap, BTreeSet};

use metrology::number::number;

use crate::evaluate::linear::LinearTest;
use crate::section::Section;

/// Readings closer than this are one, mm: below what any instrument shows.
const EQUAL_READINGS_MM: f64 = 1e-7;
/// Targets that share the value, at least: one that every run is zeroed at is no end of a range.
const LEAST_SHARING: usize = 3;
/// Readings that share it, at least, and as many times those of any other value.
const LEAST_SHARED: usize = 6;
const TIMES_THE_OTHERS: usize = 4;
/// Other values, at least: a dial of a coarse step shows few.
const LEAST_OTHER_VALUES: usize = 6;
/// What warnings of such readings have in common.
const ONE_VALUE: &str = "Readings at one value";

/// How often a value was read, and at which targets.
#[derive(Default)]
struct Shared {
    n: usize,
    targets: BTreeSet<usize>,
}

/// Warns of readings at the end of a range.
pub(super) fn name(section: &mut Section, test: &LinearTest) {
    let mut values: BTreeMap<i64, Shared> = BTreeMap::new();
    for run in test.up_mm.iter().chain(&test.down_mm) {
        for (target, mm) in run.iter().enumerate() {
            let value = ((mm + test.mean_mm) / EQUAL_READINGS_MM).round() as i64;
            let shared = values.entry(value).or_default();
            shared.n += 1;
            shared.targets.insert(target);
        }
    }
    let ends = values.first_key_value().into_iter();
    for (value, shared) in ends.chain(values.last_key_value()) {
        let others = values.iter().filter(|(other, _)| *other != value);
        let most = others.map(|(_, other)| other.n).max().unwrap_or(0);
        let is_clipped = shared.n >= LEAST_SHARED.max(TIMES_THE_OTHERS * most)
            && shared.targets.len() >= LEAST_SHARING
            && values.len() > LEAST_OTHER_VALUES;
        if is_clipped {
            section.warn(
                ONE_VALUE,
                line(*value as f64 * EQUAL_READINGS_MM, shared, test),
            );
        }
    }
}

fn line(mm: f64, shared: &Shared, test: &LinearTest) -> String {
    let runs = test.up_mm.iter().chain(&test.down_mm);
    let n: usize = runs.map(Vec::len).sum();
    let places = [shared.targets.first(), shared.targets.last()];
    let places = places.map(|k| k.and_then(|k| test.targets_mm.get(*k)).copied());
    let [from, to] = places.map(|mm| number(mm.unwrap_or(f64::NAN)));
    format!(
        "{} of {n} readings, at {} targets from {from} to {to} mm, are {} µm, an end of all, and no other value comes so often: an instrument at the end of its range shows so; repeat the test with a greater range.",
        shared.n,
        shared.targets.len(),
        number((mm * 1e7).round() * 1e-4),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five runs at eleven targets, each reading changed by `show`, µm.
    fn warned(show: impl Fn(f64) -> f64) -> Vec<String> {
        let targets_mm: Vec<f64> = (0..11).map(|k| f64::from(k) * 50.0).collect();
        let mut test = LinearTest::along_x(1, targets_mm.clone(), vec![]);
        let run = |run: u32, reversal_um: f64| -> Vec<f64> {
            let read = |(k, at_mm): (u32, &f64)| {
                let scatter_um = f64::from((run * 7 + k * 5) % 11) * 0.03;
                show(at_mm * 0.03 + reversal_um + scatter_um) * 1e-3
            };
            (0..).zip(&targets_mm).map(read).collect()
        };
        test.up_mm = (0..5).map(|k| run(k, 0.0)).collect();
        test.down_mm = (0..5).map(|k| run(k, -1.2)).collect();
        // The mean of all is taken out.
        test.mean_mm = 0.004;
        let both = test.up_mm.iter_mut().chain(&mut test.down_mm);
        both.flatten().for_each(|mm| *mm -= 0.004);
        let mut section = Section::new("X");
        name(&mut section, &test);
        section.warnings.into_iter().map(|one| one.line).collect()
    }

    #[test]
    fn readings_at_the_end_of_a_range_are_named_with_value_and_places() {
        let tenth = |um: f64| (um * 10.0).round() / 10.0;
        assert_eq!(warned(tenth), Vec::<String>::new());
        let clipped = warned(|um| tenth(um).min(10.0));
        assert_eq!(clipped.len(), 1, "{clipped:?}");
        for words in [
            "of 110 readings",
            "from 350 to 500 mm, are 10 µm",
            "greater range",
        ] {
            assert!(clipped[0].contains(words), "{words}: {clipped:?}");
        }
        let below = warned(|um| tenth(um).max(5.0));
        assert!(
            below.len() == 1 && below[0].contains("are 5 µm"),
            "{below:?}"
        );
        // A dial of 5 µm.
        assert_eq!(warned(|um| (um / 5.0).round() * 5.0), Vec::<String>::new());
        // Counted from 0 at the first target of each run.
        assert_eq!(
            warned(|um| if um < 0.5 { 0.0 } else { um }),
            Vec::<String>::new()
        );
    }
}
