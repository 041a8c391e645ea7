//! Which tables a control gets from everything that was measured, and what is left out and why.
//!
//! Positioning comes from the axis' own table where there is one, for it has more points than a fitted EXX, and from EXX
//! else. Straightness and squareness of one axis in one direction are one table. A component that is not estimable is left
//! out by name unless it is explicitly accepted. Nothing is dropped silently: what was measured and is in no file is in [`Selected::left_out`].

mod controls;

use metrology::sample::{CurveForm, GeometryModel, PositioningTable, ThermalModel};
use metrology::{Axis, AxisSet, ErrorComponent, PerAxis};

use super::axis_errors::AxisErrors;
use super::cross_errors::{CrossErrors, Unestimable};
use super::error::ExportError;
use super::file::ExportFile;
use super::grid::Grid;
use super::plausible::{self, Travels};

pub use controls::{Control, Fanuc, PitchTables, Sinumerik};

/// The last that is known of a machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Positioning tables by axis.
    pub tables: PerAxis<Option<PositioningTable>>,
    /// What a reader of each of these tables must know, a note each.
    pub remarks: PerAxis<Vec<String>>,
    /// Thermal drift.
    pub thermal: Option<ThermalModel>,
    /// Geometric errors.
    pub geometry: Option<GeometryModel>,
    /// Errors of the rotary axes.
    pub rotary: Option<GeometryModel>,
}

impl Measured {
    /// Models of geometric errors.
    fn models(&self) -> impl Iterator<Item = &GeometryModel> {
        self.geometry.iter().chain(&self.rotary)
    }
}

/// What is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// Axes whose tables are made.
    pub axes: AxisSet,
    /// Spacing of the points of linear axes, mm.
    pub spacing_mm: f64,
    /// Spacing of the points of rotary axes, rad.
    pub spacing_rad: f64,
    /// Where the control's reference point of each axis lies, mm or rad.
    pub reference: PerAxis<f64>,
    /// Whether positioning is taken relative to the error at the reference point.
    pub relative_to_reference: bool,
    /// What to do with components that are not estimable.
    pub unestimable: Unestimable,
    /// Travel of each axis by the machine file; no point of a table may lie outside. None: not known.
    pub travels: Travels,
}

/// Something measured that is in no file.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// What.
    pub what: String,
    /// Why.
    pub why: Reason,
}

/// Why something is in no file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Reason {
    /// The control or the data do not allow it.
    #[error(transparent)]
    Refused(#[from] ExportError),
    /// The axis' own table is used instead.
    #[error("the positioning table of the axis is used, which has more points")]
    TableUsed,
    /// The format has no place for it.
    #[error("{control} has no table for it")]
    NoPlace {
        /// The control.
        control: &'static str,
    },
    /// It does not grow along an axis.
    #[error("it is no function of the axis' position that a table could hold")]
    NotAlongAxis,
    /// A turn acts through an arm.
    #[error("an angular error acts through arms that a table of {control} does not know")]
    Angular {
        /// The control.
        control: &'static str,
    },
    /// A table needs its first column.
    #[error("the table of an axis needs the positioning of that axis")]
    NoPositioning,
    /// No other error of the axis tells its span.
    #[error("no recorded error of the axis says over which span it holds")]
    NoSpan,
}

impl Reason {
    /// Whether what was measured cannot be true of the machine.
    #[must_use]
    pub fn is_implausible(&self) -> bool {
        let Self::Refused(error) = self else {
            return false;
        };
        matches!(
            error,
            ExportError::Implausible { .. }
                | ExportError::TooSteep { .. }
                | ExportError::OutsideTravel { .. }
        )
    }
}

/// Files and what is in none of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selected {
    /// Files, in order of axes.
    pub files: Vec<ExportFile>,
    /// What was measured and is in none.
    pub left_out: Vec<LeftOut>,
    /// First and last recorded position of each axis whose positioning is in a file, mm or rad.
    pub positioning: PerAxis<Option<(f64, f64)>>,
}

impl Selected {
    fn leave_out(&mut self, what: impl Into<String>, why: impl Into<Reason>) {
        let (what, why) = (what.into(), why.into());
        self.left_out.push(LeftOut { what, why });
    }

    fn take(&mut self, what: &str, file: Result<ExportFile, ExportError>) {
        match file {
            Ok(file) => self.files.push(file),
            Err(error) => self.leave_out(what, error),
        }
    }

    /// A component that stands in a list of everything is not left out.
    fn list(&mut self, component: ErrorComponent) {
        let name = component.to_string();
        self.left_out.retain(|left| left.what != name);
    }

    /// A file that has the positioning of an axis, with or without more.
    fn take_positioning(&mut self, own: &AxisErrors, file: Result<ExportFile, ExportError>) {
        if file.is_ok() {
            self.positioning[own.axis()] = Some(own.span());
        }
        self.take(&format!("positioning of {}", own.axis()), file);
    }
}

/// Every error of the wanted axes, ready for a control.
#[derive(Debug, Default)]
struct Errors {
    positioning: Vec<AxisErrors>,
    cross: Vec<CrossErrors>,
}

/// Makes every file that `control` can have of what was measured.
#[must_use]
pub fn select(measured: &Measured, wanted: &Wanted, control: &Control) -> Selected {
    let mut selected = Selected::default();
    let mut errors = Errors::default();
    for axis in wanted.axes.iter() {
        if let Some(positioning) = positioning(measured, wanted, axis, &mut selected) {
            errors.positioning.push(positioning);
        }
        for model in measured.models() {
            cross(model, wanted, axis, &mut errors, &mut selected);
        }
    }
    controls::write(&errors, measured, wanted, control, &mut selected);
    selected
}

fn spacing(wanted: &Wanted, axis: Axis) -> f64 {
    if axis.is_linear() {
        wanted.spacing_mm
    } else {
        wanted.spacing_rad
    }
}

fn positioning(
    measured: &Measured,
    wanted: &Wanted,
    axis: Axis,
    selected: &mut Selected,
) -> Option<AxisErrors> {
    let own = ErrorComponent::motion(axis, axis);
    let fitted = measured.models().find(|model| has(model, own));
    let errors = match (&measured.tables[axis], fitted) {
        (Some(table), fitted) => {
            if fitted.is_some() {
                selected.leave_out(own.to_string(), Reason::TableUsed);
            }
            let errors = from_table(table, wanted);
            errors.map(|errors| errors.with_remarks(&measured.remarks[axis]))
        }
        (None, Some(model)) => span(model, axis, &[own]).map_or(Err(Reason::NoSpan), |span| {
            from_model(model, wanted, own, span)
        }),
        (None, None) => return None,
    };
    let counted = errors.and_then(|errors| {
        let errors = counted_from(&errors, wanted);
        plausible::positioning(&errors, &wanted.travels)?;
        Ok(errors)
    });
    match counted {
        Ok(errors) => Some(errors),
        Err(why) => {
            selected.leave_out(format!("positioning of {axis}"), why);
            None
        }
    }
}

/// Counted from the reference point, or as they are.
fn counted_from(errors: &AxisErrors, wanted: &Wanted) -> AxisErrors {
    if wanted.relative_to_reference {
        errors.relative_to(wanted.reference[errors.axis()])
    } else {
        errors.clone()
    }
}

fn from_table(table: &PositioningTable, wanted: &Wanted) -> Result<AxisErrors, Reason> {
    let errors = AxisErrors::from_table(table)?;
    // An outlier between two points of the grid is in no file, but the others may be wrong too.
    plausible::sizes_of(&counted_from(&errors, wanted))?;
    let grid = Grid::inside(table.axis, spacing(wanted, table.axis), errors.span())?;
    Ok(errors.on_grid(&grid)?)
}

fn from_model(
    model: &GeometryModel,
    wanted: &Wanted,
    own: ErrorComponent,
    span: (f64, f64),
) -> Result<AxisErrors, Reason> {
    let grid = Grid::inside(own.of, spacing(wanted, own.of), span)?;
    let errors = CrossErrors::sample(model, &[own], own.of, &grid, wanted.unestimable)?;
    Ok(AxisErrors::from_component(&errors)?)
}

fn has(model: &GeometryModel, component: ErrorComponent) -> bool {
    model
        .curves
        .iter()
        .any(|curve| curve.component == component)
}

/// Whether every coefficient of a component counts by itself.
fn usable(model: &GeometryModel, component: ErrorComponent, wanted: &Wanted) -> Result<(), Reason> {
    let curve = model
        .curves
        .iter()
        .find(|curve| curve.component == component);
    let bad = curve.and_then(|curve| curve.estimable.iter().position(|estimable| !estimable));
    match bad {
        Some(index) if wanted.unestimable == Unestimable::Refuse => {
            Err(ExportError::NotEstimable { component, index }.into())
        }
        _ => Ok(()),
    }
}

/// Where all of these error motions were recorded; of location errors alone, where the axis was.
fn span(model: &GeometryModel, axis: Axis, components: &[ErrorComponent]) -> Option<(f64, f64)> {
    let of = |wanted: &dyn Fn(ErrorComponent) -> bool| {
        model
            .curves
            .iter()
            .filter(|curve| curve.form != CurveForm::Constant && wanted(curve.component))
            .map(|curve| curve.span)
            .reduce(|a, b| (a.0.max(b.0), a.1.min(b.1)))
    };
    of(&|component| components.contains(&component))
        .or_else(|| of(&|component| component.of == axis))
}

/// Errors of `axis` in every other direction.
fn cross(
    model: &GeometryModel,
    wanted: &Wanted,
    axis: Axis,
    errors: &mut Errors,
    selected: &mut Selected,
) {
    let mut placed = vec![ErrorComponent::motion(axis, axis)];
    for direction in Axis::ALL.into_iter().filter(|direction| *direction != axis) {
        let mut parts = Vec::new();
        let candidates = std::iter::once(ErrorComponent::motion(direction, axis))
            .chain(Axis::ROTARY.map(|turn| ErrorComponent::location(turn, axis)));
        for component in candidates.filter(|component| has(model, *component)) {
            if !CrossErrors::acts(component, axis, direction) {
                continue;
            }
            placed.push(component);
            match usable(model, component, wanted) {
                Ok(()) => parts.push(component),
                Err(why) => selected.leave_out(component.to_string(), why),
            }
        }
        if parts.is_empty() {
            continue;
        }
        let sampled = span(model, axis, &parts).map_or(Err(Reason::NoSpan), |span| {
            let grid = Grid::inside(axis, spacing(wanted, axis), span)?;
            let sampled = CrossErrors::sample(model, &parts, direction, &grid, wanted.unestimable)?;
            plausible::cross(&sampled, &wanted.travels)?;
            Ok(sampled)
        });
        match sampled {
            Ok(sampled) => errors.cross.push(sampled),
            Err(why) => {
                let names: Vec<String> = parts.iter().map(ToString::to_string).collect();
                selected.leave_out(names.join(" + "), why);
            }
        }
    }
    let of_axis = model.curves.iter().map(|curve| curve.component);
    for component in of_axis.filter(|c| c.of == axis && !placed.contains(c)) {
        selected.leave_out(component.to_string(), Reason::NotAlongAxis);
    }
}
