//! Single readings of a displacement log that are far from those beside them.
//!
//! As at the stops of a positioning test: no machine moves by half a millimetre between readings, so such a reading takes the
//! figures of its log away; one that is far from them and may be the machine's counts and is named.

use metrology::number::number;

use crate::evaluate::circles::median;

/// Further from the middle of those about it none is that counts, mm.
const SLIP_MM: f64 = 0.5;
/// As many times the usual step, and this far, mm, is far.
const FAR_STEPS: f64 = 20.0;
const LEAST_FAR_MM: f64 = 0.005;
/// Readings on each side that a reading is held against.
const ABOUT: usize = 4;
/// Fewer readings have no usual step.
const LEAST_READINGS: usize = 10;

/// Why a log has no figure; none where no reading is a slip. Values: s from the begin, mm.
pub(super) fn slip(values: &[(f64, f64)]) -> Option<String> {
    let (place, off_mm) = from_middle(values).find(|(_, off_mm)| *off_mm > SLIP_MM)?;
    let (at_s, mm) = values[place];
    Some(format!(
        "reading {} of {}, {} s after the first, is {} mm, {} mm from those beside it, at most {SLIP_MM} mm: mend the reading or repeat the log",
        place + 1,
        values.len(),
        number(at_s),
        number(mm),
        number(off_mm)
    ))
}

/// Readings that are far from those beside them and count, a sentence each.
pub(super) fn far(values: &[(f64, f64)]) -> Vec<String> {
    if values.len() < LEAST_READINGS {
        return vec![];
    }
    let steps = values.windows(2).map(|two| (two[1].1 - two[0].1).abs());
    let usual_mm = median(steps).unwrap_or(0.0);
    let least_mm = (FAR_STEPS * usual_mm).max(LEAST_FAR_MM);
    let far = leaps(values).filter(|(_, off_mm)| (least_mm..=SLIP_MM).contains(off_mm));
    far.map(|(place, off_mm)| {
        format!(
            "reading {} of {}, {} s after the first, is {} µm from those beside it, and counts",
            place + 1,
            values.len(),
            number(values[place].0),
            number(off_mm * 1e3)
        )
    })
    .collect()
}

/// Readings that lie on one side of both beside them, with how far they are from the nearer one, mm.
fn leaps(values: &[(f64, f64)]) -> impl Iterator<Item = (usize, f64)> {
    let threes = (1..).zip(values.windows(3));
    threes.filter_map(|(place, three)| {
        let [before, after] = [three[0].1, three[2].1].map(|beside| three[1].1 - beside);
        (before * after > 0.0).then(|| (place, before.abs().min(after.abs())))
    })
}

/// How far each reading is from the middle of those about it, mm.
fn from_middle(values: &[(f64, f64)]) -> impl Iterator<Item = (usize, f64)> {
    (0..values.len()).filter_map(|place| {
        let from = place.saturating_sub(ABOUT);
        let about = values.iter().enumerate().skip(from).take(2 * ABOUT + 1);
        let others = about.filter(|(k, _)| *k != place).map(|(_, (_, mm))| *mm);
        Some((place, (values[place].1 - median(others)?).abs()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drift of 25 µm in four hours, read once a minute to 0.3 µm.
    fn log() -> Vec<(f64, f64)> {
        let um =
            |k: u32| 25.0 * (1.0 - (-f64::from(k) / 90.0).exp()) + 0.3 * f64::from(k * 7 % 5) / 5.0;
        (0..240)
            .map(|k| (60.0 * f64::from(k), um(k) * 1e-3))
            .collect()
    }

    #[test]
    fn a_slip_takes_the_figures_and_a_far_reading_is_named() {
        let mut values = log();
        assert_eq!((slip(&values), far(&values)), (None, vec![]));
        values[120].1 = 9.999;
        let said = slip(&values).unwrap();
        assert!(
            said.starts_with("reading 121 of 240, 7200 s after the first, is 9.999 mm"),
            "{said}"
        );
        // An instrument beyond its range, and the last reading.
        let mut beyond = log();
        beyond[100..103]
            .iter_mut()
            .for_each(|value| value.1 = 9.999);
        assert!(slip(&beyond).unwrap().starts_with("reading 101 of 240"));
        let mut last = log();
        last[239].1 = 0.9;
        assert!(slip(&last).unwrap().starts_with("reading 240 of 240"));
        values[120].1 = 0.090;
        assert_eq!(slip(&values), None);
        let said = far(&values);
        assert!(
            said.len() == 1 && said[0].starts_with("reading 121 of 240"),
            "{said:?}"
        );
    }
}
