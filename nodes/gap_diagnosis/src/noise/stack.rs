//! Residuals and signatures of some runs, whitened, with the set-ups' floats projected out.
//!
//! # Model
//!
//! ```text
//!   r = y - sim(machine file),   z = P W r                                (1)
//!   J = P W sim(effect)                                                   (2)
//! ```
//!
//! Responses of effects add up, so the signature of one is what the twin predicts for it alone.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use metrology::Axis;
use nalgebra::DVector;
use twin::effects::Effect;
use twin::{Channel, Session, Twin};

use crate::noise::Noise;
use crate::noise::form_error::FormError;
use crate::noise::whitener::Whitener;
use crate::search::nuisance::Nuisance;
use crate::search::rows::{Block, Rows, count, variances_within};

/// What the twin predicted for rows, by effect and the bits of its values.
type Simulated = BTreeMap<(String, Vec<u64>), Rc<[f64]>>;

/// What stacks of the same runs share.
pub type Shared = Rc<Known>;

/// What is computed once for the rows of some runs.
#[derive(Default)]
pub struct Known {
    simulated: RefCell<Simulated>,
    /// Whether their places along an axis resolve a period, by its bits.
    resolved: RefCell<BTreeMap<(Axis, u64), bool>>,
}

/// The rows of some runs with their noise.
pub struct Stack<'a> {
    /// The session.
    pub session: &'a Session,
    /// The simulator.
    pub twin: &'a Twin<'a>,
    /// The runs, places in the session.
    pub runs: Vec<usize>,
    /// Their rows.
    pub rows: Rows,
    /// Residual of each row, mm.
    pub raw: Vec<f64>,
    /// Variance of the readings within each row, mm2; none of rows with one reading.
    pub within: Rc<[Option<f64>]>,
    /// (1).
    pub z: DVector<f64>,
    whitener: Whitener,
    weight: Option<DVector<f64>>,
    nuisance: Nuisance,
    unweighted: Nuisance,
    /// Columns that float beside what set-ups leave open.
    floats: Vec<Vec<f64>>,
    /// Instants at which the session changed, seconds since its start.
    pub events_s: Rc<[f64]>,
    /// What stacks of the same runs share; nothing is kept where it is not shared.
    shared: Option<Shared>,
}

impl<'a> Stack<'a> {
    /// Stacks some runs; `residual` gives the residual of each reading of each run of the session.
    pub fn new(
        session: &'a Session,
        twin: &'a Twin<'a>,
        runs: &[usize],
        stations: usize,
        noise: &BTreeMap<Channel, Noise>,
        form: &FormError,
        residual: &[Vec<f64>],
    ) -> Self {
        let rows = Rows::new(session, runs, stations, |channel| {
            noise.contains_key(channel)
        });
        let of = |block: &Block| {
            let noise = &noise[&block.channel];
            let within = noise.within(&session.runs[block.run], block);
            (within, &noise.between)
        };
        let whitener = Whitener::new(session, &rows, of, form);
        let nuisance = Nuisance::new(twin, session, &rows, &[], |column| whitener.apply(column));
        let unweighted = Nuisance::new(twin, session, &rows, &[], |_| {});
        let mut raw = vec![0.0; rows.len];
        for &run in runs {
            rows.average(run, &residual[run], &mut raw);
        }
        let of_block = |block: &Block| variances_within(block, &residual[block.run]);
        let within = rows.blocks.iter().flat_map(of_block).collect();
        let mut stack = Self {
            session,
            twin,
            runs: runs.to_vec(),
            rows,
            raw: vec![],
            within,
            z: DVector::zeros(0),
            whitener,
            weight: None,
            nuisance,
            unweighted,
            floats: vec![],
            events_s: Rc::from([]),
            shared: None,
        };
        stack.z = stack.whitened(raw.clone());
        stack.raw = raw;
        stack
    }

    /// The same stack beside columns that float as well.
    pub(crate) fn floating(mut self, floats: Vec<Vec<f64>>) -> Self {
        if floats.is_empty() {
            return self;
        }
        self.floats = floats;
        let (twin, session) = (self.twin, self.session);
        let whiten = |column: &mut [f64]| self.whitener.apply(column);
        self.nuisance = Nuisance::new(twin, session, &self.rows, &self.floats, whiten);
        self.unweighted = Nuisance::new(twin, session, &self.rows, &self.floats, |_| {});
        self.z = self.whitened(self.raw.clone());
        self
    }

    /// The same stack where each row is known to scatter by this many times its noise.
    pub fn weighed(&self, spread: &DVector<f64>) -> Self {
        let weight = spread.map(|spread| 1.0 / spread);
        let whiten = |column: &mut [f64]| {
            self.whitener.apply(column);
            scale(column, &weight);
        };
        let nuisance = Nuisance::new(self.twin, self.session, &self.rows, &self.floats, whiten);
        let mut weighed = Self {
            runs: self.runs.clone(),
            rows: self.rows.clone(),
            raw: self.raw.clone(),
            within: Rc::clone(&self.within),
            z: DVector::zeros(0),
            whitener: self.whitener.clone(),
            weight: Some(weight),
            nuisance,
            unweighted: self.unweighted.clone(),
            floats: self.floats.clone(),
            events_s: Rc::clone(&self.events_s),
            shared: self.shared.clone(),
            ..*self
        };
        weighed.z = weighed.whitened(weighed.raw.clone());
        weighed
    }

    /// What the rows would show of some effects, mm.
    pub fn simulate(&self, effects: &[&dyn Effect]) -> Vec<f64> {
        let mut stack = vec![0.0; self.rows.len];
        for &run in &self.runs {
            let recorded = &self.session.runs[run];
            let response = self.twin.respond(self.session, recorded, effects);
            let reader = self.twin.reader(recorded, &response);
            for block in self.rows.blocks.iter().filter(|block| block.run == run) {
                for (row, mean) in block.rows.iter().zip(&mut stack[block.range()]) {
                    *mean = reader.mean(&block.channel, &row.readings);
                }
            }
        }
        stack
    }

    /// Signature (2) of one effect.
    pub fn signature(&self, effect: &dyn Effect) -> DVector<f64> {
        self.whitened(self.simulate(&[effect]))
    }

    /// The same stack, that keeps what it computes where others of the same runs find it.
    pub fn sharing(self, shared: &Shared) -> Self {
        Self {
            shared: Some(Rc::clone(shared)),
            ..self
        }
    }

    /// Whether the places along an axis resolve a period, as `compute` says, which is asked once.
    pub fn resolves(&self, axis: Axis, period_mm: f64, compute: impl FnOnce() -> bool) -> bool {
        let Some(shared) = &self.shared else {
            return compute();
        };
        let mut resolved = shared.resolved.borrow_mut();
        *resolved
            .entry((axis, period_mm.to_bits()))
            .or_insert_with(compute)
    }

    /// Signature (2) of the effect of a name at some values, which may be known from another stack of these runs.
    pub fn signature_of(&self, name: &str, values: &[f64], effect: &dyn Effect) -> DVector<f64> {
        let Some(shared) = &self.shared else {
            return self.signature(effect);
        };
        let key = (
            name.to_owned(),
            values.iter().map(|value| value.to_bits()).collect(),
        );
        let known = shared.simulated.borrow().get(&key).cloned();
        let rows = known.unwrap_or_else(|| {
            let rows: Rc<[f64]> = self.simulate(&[effect]).into();
            shared.simulated.borrow_mut().insert(key, Rc::clone(&rows));
            rows
        });
        self.whitened(rows.to_vec())
    }

    /// P W of a stack.
    pub fn whitened(&self, mut stack: Vec<f64>) -> DVector<f64> {
        self.whitener.apply(&mut stack);
        if let Some(weight) = &self.weight {
            scale(&mut stack, weight);
        }
        self.nuisance.project(&mut stack);
        DVector::from_vec(stack)
    }

    /// A whitened stack whose rows have their noise in mm again; what the smooth fields and floats took is not.
    pub fn unfiltered(&self, left: &DVector<f64>) -> Vec<f64> {
        let mut rows = left.as_slice().to_vec();
        self.whitener.unfilter(&mut rows);
        rows
    }

    /// A stack with its set-ups floated by plain least squares, mm.
    pub fn floated(&self, mut stack: Vec<f64>) -> Vec<f64> {
        self.unweighted.project(&mut stack);
        stack
    }

    /// Rows less floats.
    pub fn freedom(&self) -> f64 {
        count(self.rows.len.saturating_sub(self.nuisance.count)).max(1.0)
    }
}

fn scale(column: &mut [f64], weight: &DVector<f64>) {
    for (value, weight) in column.iter_mut().zip(weight.iter()) {
        *value *= weight;
    }
}
