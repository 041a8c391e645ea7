//! What drawings share: a linear scale, round ticks and texts within SVG.

use maud::html;

/// Most ticks of an axis: so few that their labels have room on a phone.
const MOST_TICKS: f64 = 6.0;
/// Points of a line that are drawn at most; of more, the least and the greatest of neighbours.
const MOST_POINTS: usize = 1500;

/// A linear scale from values to px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// Where the least value stands, px.
    pub low_px: f64,
    /// Where the greatest value stands, px.
    pub high_px: f64,
}

impl Scale {
    /// Place of a value, px.
    #[must_use]
    pub fn px(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        self.low_px + share * (self.high_px - self.low_px)
    }

    /// Round values within the scale, each with its text.
    #[must_use]
    pub fn ticks(&self) -> Vec<(f64, String)> {
        let step = round_step((self.high - self.low) / MOST_TICKS);
        let first = (self.low / step - 1e-9).ceil();
        (0..=2 * MOST_TICKS as u32)
            .map(|k| (first + f64::from(k)) * step)
            .take_while(|value| *value <= self.high + 1e-9 * step)
            .map(|value| (value, tick_text(value, step)))
            .collect()
    }
}

/// The least of 1, 2 and 5 times a power of ten that is not below `least`.
#[must_use]
pub fn round_step(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let decade = 10_f64.powf(least.log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|step| step * decade);
    let found = steps.into_iter().find(|step| *step >= 0.999_999 * least);
    found.unwrap_or(10.0 * decade)
}

fn tick_text(value: f64, step: f64) -> String {
    let decimals = (-(step.log10() + 1e-9).floor()).max(0.0) as usize;
    unsigned_zero(format!("{value:.decimals$}"))
}

/// A number without the sign of a zero: `-0.00` is `0.00`.
#[must_use]
pub fn unsigned_zero(number: String) -> String {
    let digits = number.strip_prefix('-').unwrap_or_default();
    let is_zero = digits.contains('0') && digits.chars().all(|c| c == '0' || c == '.');
    if is_zero { digits.to_owned() } else { number }
}

/// A value as people read it beside its place, with three significant digits.
#[must_use]
pub fn short(value: f64) -> String {
    if !value.is_finite() {
        return "—".to_owned();
    }
    let size = value.abs();
    let decimals = match () {
        () if !(1e-9..100.0).contains(&size) => 0,
        () if size >= 10.0 => 1,
        () if size >= 1.0 => 2,
        () => (2.0 - size.log10().floor()).min(9.0) as usize,
    };
    unsigned_zero(format!("{value:.decimals$}"))
}

/// A text within SVG.
#[must_use]
pub fn escaped(text: &str) -> String {
    html! { (text) }.into_string()
}

/// The finite stretches of a line, each with no more points than a drawing shows.
#[must_use]
pub fn stretches(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    let is_finite = |point: &(f64, f64)| point.0.is_finite() && point.1.is_finite();
    let all = points.split(|point| !is_finite(point));
    all.filter(|stretch| !stretch.is_empty())
        .map(thinned)
        .collect()
}

fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let bin = points.len().div_ceil(MOST_POINTS / 2);
    let ends = |chunk: &[(f64, f64)]| {
        let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let mut two: Vec<(f64, f64)> = chunk.iter().min_by(by_value).copied().into_iter().collect();
        two.extend(chunk.iter().max_by(by_value));
        two.sort_by(|a, b| a.0.total_cmp(&b.0));
        two
    };
    points.chunks(bin).flat_map(ends).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(low: f64, high: f64) -> Scale {
        Scale {
            low,
            high,
            low_px: 0.0,
            high_px: 100.0,
        }
    }

    #[test]
    fn ticks_are_round_few_and_within() {
        for (low, high, first, step) in [
            (0.0, 1.0, "0.0", 0.2),
            (-0.3, 0.3, "-0.3", 0.1),
            (1480.0, 1999.0, "1500", 100.0),
            (-2e-3, 7e-3, "-0.002", 2e-3),
        ] {
            let ticks = scale(low, high).ticks();
            assert_eq!(ticks[0].1, first);
            assert!((3..=8).contains(&ticks.len()), "{ticks:?}");
            assert!((ticks[1].0 - ticks[0].0 - step).abs() < 1e-9, "{ticks:?}");
            assert!(ticks.iter().all(|(value, _)| *value <= high + 1e-9));
        }
        let around_zero = scale(-1.0, 1.0).ticks();
        assert!(
            around_zero.iter().any(|(_, text)| text == "0.0"),
            "{around_zero:?}"
        );
    }

    #[test]
    fn a_zero_has_no_sign_and_other_numbers_keep_theirs() {
        for (number, wanted) in [
            ("-0.00", "0.00"),
            ("-0", "0"),
            ("-0.01", "-0.01"),
            ("0.00", "0.00"),
            ("-", "-"),
            ("-X", "-X"),
        ] {
            assert_eq!(unsigned_zero(number.to_owned()), wanted);
        }
    }

    #[test]
    fn a_line_breaks_where_a_value_is_missing_and_keeps_its_extremes() {
        let broken = stretches(&[(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0), (3.0, 4.0)]);
        assert_eq!(broken, [vec![(0.0, 1.0)], vec![(2.0, 3.0), (3.0, 4.0)]]);
        let mut long: Vec<(f64, f64)> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        long[77_777].1 = 9.0;
        let drawn = stretches(&long).concat();
        assert!(drawn.len() <= MOST_POINTS);
        assert!(drawn.contains(&(77_777.0, 9.0)));
    }
}
