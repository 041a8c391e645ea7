//! A quantity over time, thinned while it comes, for a curve: bounded however long it goes on.

use metrology::stamp::{Host, Span, Stamp};

/// Most points that are kept.
const MOST_COURSE_POINTS: usize = 2048;
/// Least time between two points that are kept.
const LEAST_STEP: Span = Span::from_nanos(1_000_000_000);

/// Points of one quantity in the order of their time.
#[derive(Clone, Debug, PartialEq)]
pub struct Course<T> {
    points: Vec<(Stamp<Host>, T)>,
    step_nanos: i64,
}

impl<T> Default for Course<T> {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            step_nanos: LEAST_STEP.nanos(),
        }
    }
}

impl<T> Course<T> {
    /// A later point, which is kept where it comes long enough after the last one.
    pub fn add(&mut self, at: Stamp<Host>, value: T) {
        let last = self.points.last();
        if last.is_some_and(|(last, _)| (at - *last).nanos() < self.step_nanos) {
            return;
        }
        if self.points.len() >= MOST_COURSE_POINTS {
            let mut is_kept = false;
            self.points.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.step_nanos = self.step_nanos.saturating_mul(2);
        }
        self.points.push((at, value));
    }

    /// The points that were kept.
    #[must_use]
    pub fn points(&self) -> &[(Stamp<Host>, T)] {
        &self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_course_is_bounded_and_reaches_from_begin_to_end() {
        let mut course = Course::default();
        let at = |k: i64| Stamp::from_nanos(k * 100_000_000);
        for k in 0..400_000 {
            course.add(at(k), k);
        }
        let points = course.points();
        assert!(
            (MOST_COURSE_POINTS / 2..=MOST_COURSE_POINTS).contains(&points.len()),
            "{}",
            points.len()
        );
        assert_eq!(points[0], (at(0), 0));
        let last = points[points.len() - 1].1;
        assert!(last > 399_000, "{last}");
        assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}
