//! How `ends_follow` moves the ends of a table: the rule of before `unpassed_follow`, for cells and bags that have it.
//!
//! ```text
//!   Δ(i) ← Δ(i) + change of Δ(m)   for all i beyond m,  m the outermost point passed n > (2 − ω)/ω times     (1)
//! ```
//!
//! What m takes in its first n passes is its own: an end stays behind by what the screw has grown until then.

use std::ops::Range;

/// How often each point was passed, up and down.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Ends {
    passes: [Vec<u32>; 2],
}

impl Ends {
    /// A table of so many points, none of which was passed yet.
    pub fn new(n_points: usize) -> Self {
        Self {
            passes: [vec![0; n_points], vec![0; n_points]],
        }
    }

    /// A point was passed; the points that follow it by (1), itself among them.
    pub fn pass(&mut self, point: usize, table: usize, weight: f64) -> Range<usize> {
        let passes = &mut self.passes[table];
        let alone = point..point + 1;
        let Some(count) = passes.get_mut(point) else {
            return alone;
        };
        *count = count.saturating_add(1);
        let is_settled = |count: &u32| f64::from(*count) * weight > 2.0 - weight;
        if !is_settled(count) {
            return alone;
        }
        let is_first = !passes[..point].iter().any(is_settled);
        let is_last = !passes[point + 1..].iter().any(is_settled);
        let from = if is_first { 0 } else { point };
        let to = if is_last { passes.len() } else { point + 1 };
        from..to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_the_ends_follow_the_outermost_point_that_was_passed_often_enough() {
        let mut ends = Ends::new(5);
        for _ in 0..5 {
            for point in 1..4 {
                assert_eq!(ends.pass(point, 0, 0.3), point..point + 1);
            }
        }
        // (2 - 0.3)/0.3 is 5.67: with the sixth pass.
        assert_eq!(ends.pass(3, 0, 0.3), 0..5);
        assert_eq!(ends.pass(1, 0, 0.3), 0..2);
        assert_eq!(ends.pass(2, 0, 0.3), 2..3);
        assert_eq!(ends.pass(3, 0, 0.3), 3..5);
        assert_eq!(ends.pass(3, 1, 0.3), 3..4, "the other direction");
    }
}
