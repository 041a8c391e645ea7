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
/// Part of a step that the ones beside it have at most, where it stands alone.
const STILL_PART: f64 = 0.2;
/// As many times the smallest step of all is more than one of the resolution; smaller ones are rounding, mm.
const RESOLUTIONS: f64 = 3.5;
const ROUNDING_MM: f64 = 1e-9;
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
    let moved = || values.windows(2).map(|two| (two[1].1 - two[0].1).abs());
    let usual_mm = median(moved()).unwrap_or(0.0);
    let least_mm = (FAR_STEPS * usual_mm).max(LEAST_FAR_MM);
    let far = leaps(values).filter(|(_, off_mm)| (least_mm..=SLIP_MM).contains(off_mm));
    let far = far.map(|(place, off_mm)| {
        format!(
            "reading {} of {}, {} s after the first, is {} µm from those beside it, and counts",
            place + 1,
            values.len(),
            number(values[place].0),
            number(off_mm * 1e3)
        )
    });
    // A dial shows single steps of its resolution.
    let resolution_mm = moved()
        .filter(|step_mm| *step_mm > ROUNDING_MM)
        .fold(f64::INFINITY, f64::min);
    let least_mm = least_mm.max(RESOLUTIONS * resolution_mm);
    let steps = steps(values).filter(|(_, step_mm)| step_mm.abs() > least_mm);
    let steps = steps.map(|(place, step_mm)| {
        format!(
            "from reading {place} of {}, {} s after the first, the displacement steps by {} µm to the next one, and stays there; it counts: where \
             the instrument was touched or zeroed anew repeat the log",
            values.len(),
            number(values[place - 1].0),
            number((step_mm * 1e4).round() / 10.0)
        )
    });
    far.chain(steps).collect()
}

/// Steps beside which the displacement hardly changes, with the number of the reading before, from 1, mm.
fn steps(values: &[(f64, f64)]) -> impl Iterator<Item = (usize, f64)> {
    let sixes = (3..).zip(values.windows(6));
    sixes.filter_map(|(place, six)| {
        let steps_mm: Vec<f64> = six.windows(2).map(|two| two[1].1 - two[0].1).collect();
        let step_mm = *steps_mm.get(2)?;
        let mut beside = [0, 1, 3, 4].into_iter().filter_map(|k| steps_mm.get(k));
        let is_alone = beside.all(|beside| beside.abs() < STILL_PART * step_mm.abs());
        is_alone.then_some((place, step_mm))
    })
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
    fn a_step_that_stays_is_named_and_the_begin_of_a_growth_is_none() {
        let mut values = log();
        values[150..].iter_mut().for_each(|value| value.1 -= 0.018);
        let said = far(&values);
        let begin =
            "from reading 150 of 240, 8940 s after the first, the displacement steps by -18.1 µm";
        assert!(said.len() == 1 && said[0].starts_with(begin), "{said:?}");
        // A spindle that starts: 30 µm with 5 min, read once a minute.
        let grown = |k: i32| 0.03 * (1.0 - (-f64::from((k - 100).max(0)) / 5.0).exp());
        let start: Vec<(f64, f64)> = (0..240).map(|k| (60.0 * f64::from(k), grown(k))).collect();
        assert_eq!(far(&start), Vec::<String>::new());
        // A dial of 10 µm.
        let dial: Vec<(f64, f64)> = { log().into_iter() }
            .map(|(at_s, mm)| (at_s, (mm * 1e2).round() * 1e-2))
            .collect();
        assert_eq!(far(&dial), Vec::<String>::new());
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
