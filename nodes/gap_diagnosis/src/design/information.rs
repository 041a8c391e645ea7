//! What a candidate adds to what is known of every effect's columns.
//!
//! # Model
//!
//! ```text
//!   S(r) = J_r' J_r,   J_r = P W_r sim(effect),   W_r: noise of 1/r the variance, error of form as it is   (1)
//! ```
//!
//! The mean of r repeats has 1/r of the variance of what repeats do not have in common; the error of form they have in common.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use twin::effects::{Kind, Parameter, Role};
use twin::{Twin, simulate};

use super::{Candidate, Order};
use crate::diagnose::stations;
use crate::error::GapError;
use crate::noise::form_error::FormError;
use crate::noise::normal::Normal;
use crate::noise::stack::{Shared, Stack};
use crate::preflight::{AssumedFloor, Floors, assumed};
use crate::search::resolved;
use crate::search::rows::{Rows, count};
use crate::search::signature::Instance;

/// Most stations of a pass: enough for what the run-to-run field leaves.
const STATIONS: usize = 80;
/// Most columns of one effect; further amplitudes refine its form.
pub const MOST_COLUMNS: usize = 6;

/// An instance with its columns among all.
pub struct Own {
    /// The instance.
    pub instance: Instance,
    /// Its columns.
    pub columns: Range<usize>,
    /// Places of its amplitudes among the kind's parameters.
    amplitudes: Vec<usize>,
}

impl Own {
    /// Its first amplitude, which sizes are values of.
    pub fn first(&self) -> &'static Parameter {
        &self.instance.kind.parameters[self.amplitudes[0]]
    }
}

/// The first amplitude of a kind.
pub fn first(kind: &Kind) -> Option<&'static Parameter> {
    let mut all = kind.parameters.iter();
    all.find(|parameter| parameter.role == Role::Amplitude)
}

/// Columns of some instances, one behind the other; one without an amplitude has none and is left out.
pub fn columns(instances: Vec<Instance>) -> Vec<Own> {
    let mut all = Vec::new();
    let mut next = 0;
    for instance in instances {
        let parameters = instance.kind.parameters.iter().enumerate();
        let amplitudes: Vec<usize> = parameters
            .filter(|(_, parameter)| parameter.role == Role::Amplitude)
            .map(|(place, _)| place)
            .take(MOST_COLUMNS)
            .collect();
        if amplitudes.is_empty() {
            continue;
        }
        let columns = next..next + amplitudes.len();
        next = columns.end;
        all.push(Own {
            instance,
            columns,
            amplitudes,
        });
    }
    all
}

/// (1) for 1, 2, ... repeats of a candidate.
pub fn of(
    candidate: &Candidate,
    owns: &[Own],
    twin: &Twin<'_>,
    order: &Order<'_>,
) -> Result<Vec<DMatrix<f64>>, GapError> {
    let session = &candidate.session;
    simulate::check(session)?;
    let n = owns.last().map_or(0, |own| own.columns.end);
    let runs: Vec<usize> = (0..session.runs.len()).collect();
    let stations = stations(session, &runs, order.config).min(STATIONS);
    let rows = Rows::new(session, &runs, stations, |channel| {
        order.floors.contains_key(&channel.instrument())
    });
    if rows.len == 0 {
        return Ok(vec![DMatrix::zeros(n, n); candidate.most_repeats]);
    }
    let zero = session.runs.iter().map(|run| vec![0.0; run.readings.len()]);
    let nothing: Vec<Vec<f64>> = zero.collect();
    let form = FormError::base(order.config);
    let shared = Shared::default();
    let of_repeats = |repeats: usize| {
        let noise = assumed(&rows, &quieter(order.floors, repeats));
        let stack = Stack::new(session, twin, &runs, stations, &noise, &form, &nothing);
        gram(&stack.sharing(&shared), owns)
    };
    Ok((1..=candidate.most_repeats).map(of_repeats).collect())
}

/// Floors of the mean of some repeats.
fn quieter(floors: &Floors, repeats: usize) -> Floors {
    let share = 1.0 / count(repeats).sqrt();
    let of_mean = |floor: &AssumedFloor| AssumedFloor {
        reading_um: share * floor.reading_um,
        between_runs_um: share * floor.between_runs_um,
    };
    floors
        .iter()
        .map(|(instrument, floor)| (*instrument, of_mean(floor)))
        .collect()
}

fn gram(stack: &Stack<'_>, owns: &[Own]) -> DMatrix<f64> {
    let rows = stack.rows.len;
    let mut columns = Vec::<DVector<f64>>::new();
    for own in owns {
        let parameters = own.instance.kind.parameters;
        let mut values = own.instance.kind.typical();
        for (value, parameter) in values.iter_mut().zip(parameters) {
            if parameter.role == Role::Amplitude {
                *value = 0.0;
            }
        }
        let is_shown = resolved::shows(stack, &own.instance, &values);
        for place in &own.amplitudes {
            let column = is_shown.then(|| {
                let mut on = values.clone();
                on[*place] = parameters[*place].typical;
                stack.signature_of(&own.instance.name(), &on, &*own.instance.effect(&on))
            });
            let finite = column.filter(|column| column.iter().all(|value| value.is_finite()));
            columns.push(finite.unwrap_or_else(|| DVector::zeros(rows)));
        }
    }
    if columns.is_empty() {
        return DMatrix::zeros(0, 0);
    }
    Normal::new(&DMatrix::from_columns(&columns), &DVector::zeros(rows)).gram
}
