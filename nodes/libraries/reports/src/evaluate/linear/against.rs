//! Runs whose readings do not go with the axis: a reversed sign, another unit, or a reference that did not follow.
//!
//! Readings and targets are in one unit and count in one direction, so the slope of one over the other is 1 within what a machine
//! can be off. A run of another slope is no deviation of an axis.

use super::slips::{SLIP, size};

/// Greatest distance of the slope from 1.
const GREATEST_OFF_ONE: f64 = 0.1;

/// A reading with where the axis rested, both in mm or both in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::evaluate) struct Pair {
    /// Where the program sent the axis.
    pub at: f64,
    /// Reading minus that.
    pub deviation: f64,
}

/// Why the readings of a run are not of its axis; `None`: they go with it.
pub(in crate::evaluate) fn against(is_linear: bool, pairs: &[Pair]) -> Option<String> {
    let slope = slope(pairs)?;
    let places = || pairs.iter().map(|pair| pair.at);
    let low = places().fold(f64::INFINITY, f64::min);
    let way = places().fold(f64::NEG_INFINITY, f64::max) - low;
    let limit = SLIP[usize::from(!is_linear)];
    let is_off = (slope - 1.0).abs() > GREATEST_OFF_ONE && (slope - 1.0).abs() * way > limit;
    let why = if (slope + 1.0).abs() <= GREATEST_OFF_ONE {
        "the reading runs against the axis: correct the sign or the direction of the beam"
    } else {
        "the reading does not go with the axis: correct its unit or its axis, or repeat the run"
    };
    is_off.then(|| {
        format!(
            "its readings change by {slope:.3} of the way of the axis, {} in all: at most {GREATEST_OFF_ONE} from 1; {why}",
            size(is_linear, (slope - 1.0).abs() * way)
        )
    })
}

/// Of reading over place; `None`: all rested at one.
fn slope(pairs: &[Pair]) -> Option<f64> {
    let n = pairs.len() as f64;
    let mean = |of: fn(&Pair) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (at, deviation) = (mean(|it| it.at), mean(|it| it.deviation));
    let square: f64 = pairs.iter().map(|it| (it.at - at).powi(2)).sum();
    let product = pairs
        .iter()
        .map(|it| (it.at - at) * (it.deviation - deviation));
    (square > 0.0).then(|| 1.0 + product.sum::<f64>() / square)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run to and fro over so much, whose reading is this many times the place.
    fn of(factor: f64, way_mm: f64) -> Option<String> {
        let places = (0..=10).map(|k| way_mm * f64::from(k) / 10.0);
        let pairs: Vec<Pair> = places
            .map(|at| Pair {
                at,
                deviation: at * (factor - 1.0) + 0.003,
            })
            .collect();
        against(true, &pairs)
    }

    #[test]
    fn a_reading_against_the_axis_is_refused_and_so_is_another_unit() {
        for (factor, way_mm) in [
            (1.0, 500.0),
            (1.016, 500.0),
            (0.95, 500.0),
            (-1.0, 0.2),
            (1.0, 0.0),
        ] {
            assert_eq!(of(factor, way_mm), None, "{factor} over {way_mm} mm");
        }
        let words = "its readings change by -1.000 of the way of the axis, 1000000 µm in all: at most 0.1 from 1; the reading runs against the axis";
        let why = of(-1.0, 500.0).unwrap();
        assert!(why.starts_with(words), "{why}");
        for factor in [0.0, 0.0394, 25.4, 2.0, -2.0, 1000.0] {
            let why = of(factor, 500.0).unwrap();
            assert!(why.contains("does not go with the axis"), "{why}");
        }
    }
}
