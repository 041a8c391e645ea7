//! Positioning errors of one axis, run up and run down, at ascending points.

use metrology::sample::PositioningTable;
use metrology::{Axis, ErrorComponent};

use super::cross_errors::CrossErrors;
use super::error::ExportError;
use super::file::one_line;
use super::grid::{Grid, SAME};
use machine::volumetric::on_line;

/// Positioning errors of an axis: actual minus commanded, checked and at ascending points.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisErrors {
    axis: Axis,
    position: Vec<f64>,
    up: Vec<f64>,
    down: Vec<f64>,
    /// What a reader of a table must know of them, a note each.
    remarks: Vec<String>,
}

impl AxisErrors {
    /// Errors at `position` in runs towards greater (`up`) and smaller (`down`) positions; mm or rad.
    ///
    /// # Errors
    /// Lists of different lengths, fewer than two points, points that do not ascend, numbers that are none.
    pub fn new(
        axis: Axis,
        position: Vec<f64>,
        up: Vec<f64>,
        down: Vec<f64>,
    ) -> Result<Self, ExportError> {
        check_positions(axis, &position)?;
        check_values(axis, "error up", &up, position.len())?;
        check_values(axis, "error down", &down, position.len())?;
        Ok(Self {
            axis,
            position,
            up,
            down,
            remarks: vec![],
        })
    }

    /// With notes that stand in every file that is made of them.
    #[must_use]
    pub fn with_remarks(self, remarks: &[String]) -> Self {
        let remarks = remarks.iter().map(|remark| one_line(remark)).collect();
        Self { remarks, ..self }
    }

    /// Notes that stand in every file that is made of them.
    #[must_use]
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// The deviations of a table. Scale minus motor is where the slide is minus where the control, which
    /// knows the motor only, believes it to be: the positioning error itself.
    ///
    /// # Errors
    /// As [`AxisErrors::new`].
    pub fn from_table(table: &PositioningTable) -> Result<Self, ExportError> {
        Self::new(
            table.axis,
            table.position.clone(),
            table.deviation_up.clone(),
            table.deviation_down.clone(),
        )
    }

    /// An error that is the same in both directions, such as a fitted EXX.
    ///
    /// # Errors
    /// When it is an error in another direction than that of its axis.
    pub fn from_component(errors: &CrossErrors) -> Result<Self, ExportError> {
        let (axis, direction) = (errors.base(), errors.direction());
        if axis != direction {
            let component = ErrorComponent::motion(direction, axis);
            return Err(ExportError::NoEffect {
                component,
                base: axis,
                direction: axis,
            });
        }
        let error = errors.error().to_vec();
        Self::new(axis, errors.position().to_vec(), error.clone(), error)
    }

    /// The same errors at the points of `grid`, on straight lines between the own points.
    ///
    /// # Errors
    /// A grid of another axis, or a point beyond the first or last own one.
    pub fn on_grid(&self, grid: &Grid) -> Result<Self, ExportError> {
        let position: Vec<f64> = grid.positions().collect();
        check_inside(self.axis, grid.axis(), &self.position, &position)?;
        let sample = |error: &[f64]| -> Vec<f64> {
            position
                .iter()
                .map(|at| on_line(&self.position, error, *at))
                .collect()
        };
        let (up, down) = (sample(&self.up), sample(&self.down));
        let sampled = Self::new(self.axis, position, up, down)?;
        Ok(sampled.with_remarks(&self.remarks))
    }

    /// Relative to the error at `reference`: there the mean of both directions becomes zero. Allowed because
    /// a control is zero where it is referenced; the offset belongs to the reference point, not to the axis.
    /// Beyond the first and last point their errors count.
    #[must_use]
    pub fn relative_to(&self, reference: f64) -> Self {
        let offset = self.mean_at(reference);
        let less = |error: &[f64]| error.iter().map(|e| e - offset).collect();
        Self {
            axis: self.axis,
            position: self.position.clone(),
            up: less(&self.up),
            down: less(&self.down),
            remarks: self.remarks.clone(),
        }
    }

    /// Mean of both directions, for controls that have one table for both.
    #[must_use]
    pub fn mean(&self) -> Self {
        let mean: Vec<f64> = self
            .up
            .iter()
            .zip(&self.down)
            .map(|(up, down)| f64::midpoint(*up, *down))
            .collect();
        Self {
            axis: self.axis,
            position: self.position.clone(),
            up: mean.clone(),
            down: mean,
            remarks: self.remarks.clone(),
        }
    }

    /// Up minus down, averaged over the points: the reversal value that a table for both directions leaves.
    #[must_use]
    pub fn mean_reversal(&self) -> f64 {
        let sum: f64 = self
            .up
            .iter()
            .zip(&self.down)
            .map(|(up, down)| up - down)
            .sum();
        sum / self.position.len() as f64
    }

    /// The axis.
    #[must_use]
    pub fn axis(&self) -> Axis {
        self.axis
    }

    /// Points, ascending, mm or rad.
    #[must_use]
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Errors in runs towards greater positions, mm or rad.
    #[must_use]
    pub fn up(&self) -> &[f64] {
        &self.up
    }

    /// Errors in runs towards smaller positions, mm or rad.
    #[must_use]
    pub fn down(&self) -> &[f64] {
        &self.down
    }

    /// First and last point, mm or rad.
    #[must_use]
    pub fn span(&self) -> (f64, f64) {
        (self.position[0], self.position[self.position.len() - 1])
    }

    /// Mean of both directions at `at`, held beyond the first and last point; mm or rad.
    pub(super) fn mean_at(&self, at: f64) -> f64 {
        let up = on_line(&self.position, &self.up, at);
        let down = on_line(&self.position, &self.down, at);
        f64::midpoint(up, down)
    }

    /// The common error of both directions.
    pub(super) fn of_both_directions(&self, control: &'static str) -> Result<&[f64], ExportError> {
        for ((at, up), down) in self.position.iter().zip(&self.up).zip(&self.down) {
            let difference = up - down;
            if difference.abs() > SAME {
                let (axis, position) = (self.axis, *at);
                return Err(ExportError::DirectionDependent {
                    control,
                    axis,
                    position,
                    difference,
                });
            }
        }
        Ok(&self.up)
    }
}

/// Positions of a table: at least two, numbers, ascending.
pub(super) fn check_positions(axis: Axis, position: &[f64]) -> Result<(), ExportError> {
    check_values(axis, "position", position, position.len())?;
    let n = position.len();
    if n < 2 {
        return Err(ExportError::TooFewPoints { axis, n, least: 2 });
    }
    for (before, pair) in position.windows(2).enumerate() {
        if pair[1] <= pair[0] {
            return Err(ExportError::NotAscending {
                axis,
                index: before + 1,
                position: pair[1],
                before: pair[0],
            });
        }
    }
    Ok(())
}

/// One number for each position.
pub(super) fn check_values(
    axis: Axis,
    quantity: &'static str,
    values: &[f64],
    positions: usize,
) -> Result<(), ExportError> {
    let n = values.len();
    if n != positions {
        return Err(ExportError::Lengths {
            axis,
            quantity,
            n,
            positions,
        });
    }
    match values
        .iter()
        .enumerate()
        .find(|(_, value)| !value.is_finite())
    {
        Some((index, &value)) => Err(ExportError::NotFinite {
            axis,
            quantity,
            index,
            value,
        }),
        None => Ok(()),
    }
}

/// Not more points than `limit`.
pub(super) fn check_count(
    control: &'static str,
    axis: Axis,
    n: usize,
    limit: usize,
) -> Result<(), ExportError> {
    if n > limit {
        return Err(ExportError::TooManyPoints {
            control,
            axis,
            n,
            limit,
        });
    }
    Ok(())
}

/// The one spacing of a table, mm or rad.
pub(super) fn equal_spacing(
    control: &'static str,
    axis: Axis,
    position: &[f64],
) -> Result<f64, ExportError> {
    let first = position[1] - position[0];
    for (before, pair) in position.windows(2).enumerate() {
        let spacing = pair[1] - pair[0];
        if (spacing - first).abs() > SAME {
            let index = before + 1;
            return Err(ExportError::UnequalSpacing {
                control,
                axis,
                index,
                spacing,
                first,
            });
        }
    }
    let n = position.len() - 1;
    Ok((position[n] - position[0]) / n as f64)
}

/// Every point of another axis' or the same axis' grid lies between the first and last own point.
pub(super) fn check_inside(
    own: Axis,
    axis: Axis,
    measured: &[f64],
    wanted: &[f64],
) -> Result<(), ExportError> {
    let (least, greatest) = (measured[0], measured[measured.len() - 1]);
    let inside = |at: &f64| (least - SAME..=greatest + SAME).contains(at);
    match wanted.iter().find(|at| own != axis || !inside(at)) {
        Some(&position) => Err(ExportError::OutsideMeasured {
            axis,
            position,
            least,
            greatest,
        }),
        None => Ok(()),
    }
}
