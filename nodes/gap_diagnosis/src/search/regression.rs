//! The residual of a recording beside the signatures of every effect: what any method of naming starts from.
//!
//! # Model
//!
//! With the residual z and the signatures J of `signature`, both whitened and with the set-ups' floats out,
//!
//! ```text
//!   z = sum over effects of J beta + noise,   noise ~ N(0, 1)             (1)
//! ```
//!
//! for the runs that a diagnosis fits. A method that chooses effects by least squares needs no more than
//!
//! ```text
//!   G = J'J,   b = J'z,   z'z                                             (2)
//! ```
//!
//! The diagnosis' own search works on these too, but goes on from them: wide forms, another noise once effects are
//! known, runs left out, rivals, and the question whether anything is left. Methods that are compared with it start
//! here, so that what differs is the choosing.
//!
//! # Holds when
//! Sizes are in units of each amplitude's typical size (`twin::effects`), so that sqrt(G_kk) is the D that column k
//! has at its typical size.

use std::ops::Range;

use machine::MachineFile;
use nalgebra::{DMatrix, DVector};
use twin::Session;
use twin::effects::{Kind, Moment};

use crate::config::GapConfig;
use crate::diagnose;
use crate::error::GapError;
use crate::noise::stack::Stack;
use crate::report::figures::Isolability;
use crate::search::isolability;
use crate::search::rows::count;
use crate::search::signature::{Instance, Library};

/// One form of one effect: a point of the grid of its shapes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// Place of its effect in [`Regression::effects`].
    pub effect: usize,
    /// Its columns, one for each amplitude.
    pub columns: Range<usize>,
    /// Parameters that it has: amplitudes, and shapes with a choice.
    pub parameters: usize,
}

/// (2) for the whole catalogue.
#[derive(Clone, Debug)]
pub struct Regression {
    /// Every effect that the machine can have: id, and what it acts on.
    pub effects: Vec<(String, String)>,
    /// Whether the recording could show it, place by place.
    pub excited: Vec<bool>,
    /// The forms of those that it could show.
    pub candidates: Vec<Candidate>,
    /// G.
    pub gram: DMatrix<f64>,
    /// b.
    pub along: DVector<f64>,
    /// z'z.
    pub square: f64,
    /// Rows less floats.
    pub freedom: f64,
    /// What can be told from what before anything is found, one form for each effect.
    pub isolability: Isolability,
}

/// The regression problem of a session; effects of `config.left_out` are not in it.
///
/// # Errors
/// As [`diagnose`](crate::diagnose()).
pub fn regression(
    machine: &MachineFile,
    session: &Session,
    config: &GapConfig,
) -> Result<Regression, GapError> {
    diagnose::signatures(machine, session, config)
}

impl Regression {
    pub(crate) fn new(stack: &Stack<'_>, kinds: &[&'static Kind]) -> Self {
        let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
        let library = Library::new(stack, Instance::all(stack.twin.machine(), means));
        let normal = library.normal(&stack.z);
        let chosen = isolability::forms(&library, &normal, &[]);
        let candidate = |form: &crate::search::signature::Form| {
            let first = form.columns.first().copied().unwrap_or(0);
            Candidate {
                effect: form.instance,
                columns: first..first + form.columns.len(),
                parameters: form.price,
            }
        };
        let name = |instance: &Instance| (instance.kind.id.to_owned(), instance.target.to_string());
        Self {
            effects: library.instances.iter().map(name).collect(),
            excited: library.excited.clone(),
            candidates: library.forms.iter().map(candidate).collect(),
            isolability: isolability::isolability(&library, &normal, &chosen, stack.freedom()),
            gram: normal.gram,
            along: normal.along,
            square: stack.z.norm_squared(),
            freedom: stack.freedom(),
        }
    }

    /// Number of effects that the recording could show.
    #[must_use]
    pub fn seen(&self) -> usize {
        self.excited.iter().filter(|seen| **seen).count()
    }

    /// What a set of a number of effects with some parameters costs in chi-square by the criterion of `selection`:
    /// q ln n + 2 |S| ln K.
    #[must_use]
    pub fn price(&self, effects: usize, parameters: usize) -> f64 {
        let log_effects = count(self.seen().max(2)).ln();
        count(parameters) * self.freedom.max(2.0).ln() + 2.0 * count(effects) * log_effects
    }
}
