//! The first search of a session as numbers alone, so that another program can solve it and be compared.
//!
//! ```text
//!   C(S) = |z|^2 - gain(S) + q ln n + 2 |S| ln K                          (1)
//! ```
//!
//! as in `selection`: gain from the Gram matrix of the signatures, forms with their columns, what each costs, and
//! which sizes physics has.

use machine::MachineFile;
use serde::Serialize;
use twin::Session;
use twin::effects::Moment;

use crate::config::GapConfig;
use crate::diagnose::first_stack;
use crate::error::GapError;
use crate::noise::normal::Normal;
use crate::search::rows::count;
use crate::search::selection::{Limits, MOST_CANCELLING, MOST_FORMS, MOST_FREE, Search, Set};
use crate::search::signature::{Instance, Library};

/// One form of an effect among the columns of a [`Problem`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FormOf {
    /// Which effect on which target; forms of one instance exclude each other.
    pub instance: usize,
    /// Columns of the Gram matrix.
    pub columns: Vec<usize>,
    /// Parameters that are paid for.
    pub price: usize,
    /// Least and greatest size of each column, in units of what the column was made with.
    pub sizes: Vec<[f64; 2]>,
    /// Columns that only widen the form; their share of a signature is limited.
    pub widens: Vec<bool>,
}

/// A search: (1) is to be least.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Problem {
    /// Gram matrix of the whitened signatures, row by row.
    pub gram: Vec<Vec<f64>>,
    /// Signatures along the whitened residual.
    pub along: Vec<f64>,
    /// |z|^2.
    pub square: f64,
    /// ln n.
    pub log_rows: f64,
    /// ln K.
    pub log_instances: f64,
    /// Forms.
    pub forms: Vec<FormOf>,
    /// Sets that are followed side by side.
    pub beam: usize,
    /// Most effects in one set.
    pub most_effects: usize,
    /// Forms of one instance that are tried beside a set.
    pub most_forms: usize,
    /// Most that the widening part of a form is of the rest of it.
    pub most_free: f64,
    /// Most that a member is of what the whole set explains, in squares.
    pub most_cancelling: f64,
}

/// A problem with what solves it here.
pub struct Posed {
    /// As numbers.
    pub problem: Problem,
    signatures: Library,
    normal: Normal,
    freedom: f64,
}

impl Posed {
    /// The problem of a session.
    ///
    /// # Errors
    /// As [`crate::diagnose`].
    pub fn new(
        machine: &MachineFile,
        session: &Session,
        config: &GapConfig,
    ) -> Result<Self, GapError> {
        first_stack(machine, session, config, |stack, kinds| {
            let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
            let signatures = Library::new(stack, Instance::all(machine, means));
            let normal = signatures.normal(&stack.z);
            let problem = problem(&signatures, &normal, stack.z.norm_squared(), config);
            let freedom = stack.freedom();
            Self {
                problem: Problem {
                    log_rows: freedom.max(2.0).ln(),
                    ..problem
                },
                signatures,
                normal,
                freedom,
            }
        })
    }

    /// The best set and its C.
    #[must_use]
    pub fn solved(&self) -> (Set, f64) {
        let problem = &self.problem;
        let mut search = Search::new(&self.signatures, &self.normal, problem.square, self.freedom);
        let set = search.run(Limits {
            beam: problem.beam,
            most_effects: problem.most_effects,
            swaps: true,
        });
        let score = search.score(&set);
        (set, score)
    }
}

fn problem(signatures: &Library, normal: &Normal, square: f64, config: &GapConfig) -> Problem {
    let forms = signatures.forms.iter().map(|form| {
        let kind = signatures.instances[form.instance].kind;
        let parameters = || kind.parameters.iter().chain(kind.free);
        let sizes = form.amplitudes.iter().map(|place| {
            parameters().nth(*place).map_or([f64::MIN, f64::MAX], |p| {
                let most = 1.5 * p.low.abs().max(p.high.abs()) / p.typical;
                [if p.low < 0.0 { -most } else { 0.0 }, most]
            })
        });
        let own = kind.parameters.len();
        let widens =
            |place: &usize| form.wide && *place >= own && !kind.free[place - own].is_ordinate;
        FormOf {
            instance: form.instance,
            columns: form.columns.clone(),
            price: form.price,
            sizes: sizes.collect(),
            widens: form.amplitudes.iter().map(widens).collect(),
        }
    });
    Problem {
        gram: normal
            .gram
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect(),
        along: normal.along.iter().copied().collect(),
        square,
        log_rows: 0.0,
        log_instances: count(signatures.seen().max(2)).ln(),
        forms: forms.collect(),
        beam: config.beam,
        most_effects: config.most_effects,
        most_forms: MOST_FORMS,
        most_free: MOST_FREE,
        most_cancelling: MOST_CANCELLING,
    }
}
