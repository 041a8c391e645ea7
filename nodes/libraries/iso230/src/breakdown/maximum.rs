//! Where a smooth function of one number is greatest, and how well that place is known.
//!
//! # Model
//! Brent's method: a parabola through the three best places where it helps, a golden section where it
//! does not. About ten values of the function instead of the forty of golden sections alone.
//!
//! # References
//! \[1\] R. P. Brent, Algorithms for Minimization without Derivatives, Prentice-Hall 1973, chapter 5.

/// Most steps.
const STEPS: usize = 60;
/// Share of the bracket to which the place is found.
const SHARE: f64 = 1e-6;
/// The smaller part of a golden section.
const GOLDEN: f64 = 0.381_966_011_250_105_1;

/// A place and the function's value there.
#[derive(Clone, Copy, Debug)]
struct Tried {
    at: f64,
    value: f64,
}

/// Where `f` is greatest between two bounds.
pub(super) fn greatest(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let tolerance = SHARE * (high - low).abs();
    let tried = |at: f64| Tried { at, value: f(at) };
    let (mut low, mut high) = (low, high);
    let mut best = tried(low + GOLDEN * (high - low));
    let (mut second, mut third) = (best, best);
    let (mut step, mut before) = (0.0_f64, 0.0_f64);
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if (best.at - middle).abs() <= 2.0 * tolerance - 0.5 * (high - low) {
            break;
        }
        let parabola = vertex(best, second, third)
            .map(|at| at - best.at)
            .filter(|way| way.abs() < 0.5 * before.abs())
            .filter(|way| best.at + way > low && best.at + way < high);
        before = step;
        step = parabola.unwrap_or_else(|| {
            before = if best.at < middle { high } else { low } - best.at;
            GOLDEN * before
        });
        let way = if step.abs() < tolerance {
            tolerance.copysign(step)
        } else {
            step
        };
        let next = tried(best.at + way);
        if next.value >= best.value {
            *(if next.at >= best.at {
                &mut low
            } else {
                &mut high
            }) = best.at;
            (third, second, best) = (second, best, next);
        } else {
            *(if next.at < best.at {
                &mut low
            } else {
                &mut high
            }) = next.at;
            if next.value >= second.value || second.at.to_bits() == best.at.to_bits() {
                (third, second) = (second, next);
            } else {
                third = next;
            }
        }
    }
    best.at
}

/// The vertex of the parabola through three places.
fn vertex(a: Tried, b: Tried, c: Tried) -> Option<f64> {
    let (ab, ac) = (a.at - b.at, a.at - c.at);
    let (p, q) = (ab * (a.value - c.value), ac * (a.value - b.value));
    let bottom = 2.0 * (p - q);
    (bottom.abs() > 0.0).then(|| a.at - (ab * p - ac * q) / bottom)
}

/// Standard uncertainty of the place of a maximum of Δ: √(2 variance/−Δ'').
pub(super) fn by_curvature(at: f64, step: f64, variance: f64, gain: impl Fn(f64) -> f64) -> f64 {
    let second = (gain(at + step) - 2.0 * gain(at) + gain(at - step)) / (step * step);
    if second < 0.0 {
        (2.0 * variance / -second).sqrt()
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn a_maximum_is_found_to_a_millionth_of_its_bracket_with_few_values() {
        for wanted in [0.02, 0.3, 0.77, 0.999] {
            let n = Cell::new(0);
            let at = greatest(0.0, 1.0, |x| {
                n.set(n.get() + 1);
                (-(x - wanted).powi(2) * 3.0).exp() + 0.01 * (x - wanted).powi(3)
            });
            assert!((at - wanted).abs() < 1e-5, "{at} {wanted}");
            assert!(n.get() < 30, "{}", n.get());
        }
    }

    #[test]
    fn a_function_that_only_rises_is_greatest_at_the_bound() {
        assert!((greatest(1.0, 3.0, |x| x) - 3.0).abs() < 1e-5);
        assert!((greatest(1.0, 3.0, |x| -x) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_parabola_of_known_curvature_has_a_known_uncertainty() {
        let u = by_curvature(2.0, 0.1, 0.5, |x| 1.0 - 2.0 * (x - 2.0).powi(2));
        assert!((u - 0.5).abs() < 1e-9, "{u}");
    }
}
