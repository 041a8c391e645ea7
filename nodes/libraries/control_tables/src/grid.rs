//! Equally spaced points along an axis.

use metrology::Axis;

use super::error::ExportError;

/// Distance that two positions may differ by and still be the same, mm or rad: far below any encoder.
pub(super) const SAME: f64 = 1e-7;

/// Far more points than any control takes: a spacing in the wrong unit ends here.
const MAX_GRID_POINTS: usize = 100_000;

/// Points `start + k spacing`, mm or rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    axis: Axis,
    start: f64,
    spacing: f64,
    count: usize,
}

impl Grid {
    /// `count` points of `axis` from `start`, all inside `travel`; mm or rad.
    ///
    /// # Errors
    /// Fewer than two or more than 100,000 points, a spacing that is none, a point outside the travel, numbers that are none.
    pub fn new(
        axis: Axis,
        start: f64,
        spacing: f64,
        count: usize,
        travel: (f64, f64),
    ) -> Result<Self, ExportError> {
        let numbers = [("start", start), ("travel", travel.0), ("travel", travel.1)];
        for (quantity, value) in numbers {
            if !value.is_finite() {
                let index = 0;
                return Err(ExportError::NotFinite {
                    axis,
                    quantity,
                    index,
                    value,
                });
            }
        }
        if !spacing.is_finite() || spacing <= SAME {
            let least = SAME;
            return Err(ExportError::Spacing {
                axis,
                spacing,
                least,
            });
        }
        if count < 2 {
            let (n, least) = (count, 2);
            return Err(ExportError::TooFewPoints { axis, n, least });
        }
        if count > MAX_GRID_POINTS {
            let (control, n, limit) = ("a grid", count, MAX_GRID_POINTS);
            return Err(ExportError::TooManyPoints {
                control,
                axis,
                n,
                limit,
            });
        }
        let grid = Self {
            axis,
            start,
            spacing,
            count,
        };
        let (least, greatest) = travel;
        let outside = [grid.position(0), grid.position(count - 1)]
            .into_iter()
            .find(|position| !(least - SAME..=greatest + SAME).contains(position));
        match outside {
            Some(position) => Err(ExportError::OutsideTravel {
                axis,
                position,
                least,
                greatest,
            }),
            None => Ok(grid),
        }
    }

    /// Whole spacings inside `span`, from its multiple of `spacing` nearest above the least position; mm or rad.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn inside(axis: Axis, spacing: f64, span: (f64, f64)) -> Result<Self, ExportError> {
        if !spacing.is_finite() || spacing <= SAME {
            let least = SAME;
            return Err(ExportError::Spacing {
                axis,
                spacing,
                least,
            });
        }
        let first = ((span.0 - SAME) / spacing).ceil();
        let last = ((span.1 + SAME) / spacing).floor();
        // A span that is no number gives no points, which `new` refuses by name.
        let count = ((last - first).max(-1.0) as usize).saturating_add(usize::from(last >= first));
        Self::new(axis, first * spacing, spacing, count, span)
    }

    /// The axis.
    #[must_use]
    pub fn axis(&self) -> Axis {
        self.axis
    }

    /// Number of points.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Position of point `k`, mm or rad.
    #[must_use]
    pub fn position(&self, k: usize) -> f64 {
        self.start + self.spacing * k as f64
    }

    /// Every position, ascending, mm or rad.
    pub fn positions(&self) -> impl Iterator<Item = f64> {
        (0..self.count).map(|k| self.position(k))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_stay_inside_the_travel_and_on_whole_spacings() {
        let grid = Grid::inside(Axis::X, 20.0, (-305.0, 290.0)).unwrap();
        assert_eq!((grid.position(0), grid.count()), (-300.0, 30));
        let tenth = Grid::inside(Axis::X, 0.1, (-0.3, 0.3)).unwrap();
        assert_eq!(tenth.count(), 7);
    }

    #[test]
    fn a_grid_that_is_none_is_refused_by_name() {
        let travel = (-100.0, 100.0);
        let refused = [
            Grid::new(Axis::X, -100.0, 50.0, 6, travel),
            Grid::new(Axis::X, f64::NAN, 50.0, 3, travel),
            Grid::new(Axis::X, 0.0, f64::INFINITY, 3, travel),
            Grid::new(Axis::X, 0.0, -1.0, 3, travel),
            Grid::new(Axis::X, 0.0, 1.0, 1, travel),
            Grid::inside(Axis::X, 500.0, (1.0, 100.0)),
            Grid::inside(Axis::X, 5.0, (f64::NAN, 100.0)),
            Grid::inside(Axis::X, 1e-5, travel),
            Grid::inside(Axis::X, 1.0, (f64::NEG_INFINITY, f64::INFINITY)),
        ];
        let names: Vec<String> = refused
            .into_iter()
            .map(|refused| refused.unwrap_err().to_string())
            .collect();
        assert_eq!(
            names,
            [
                "axis X: point at 150 mm: the travel is from -100 mm to 100 mm",
                "axis X: start[0] = NaN: must be finite",
                "axis X: spacing inf mm: must be a finite number above 1e-7 mm",
                "axis X: spacing -1 mm: must be a finite number above 1e-7 mm",
                "axis X: 1 points: at least 2 are needed",
                "axis X: 0 points: at least 2 are needed",
                "axis X: start[0] = NaN: must be finite",
                "axis X: 20000001 points: a grid takes at most 100000",
                "axis X: start[0] = -inf: must be finite",
            ]
        );
    }
}
