//! The searches of one diagnosis: which runs, with what noise, how often.

use std::collections::BTreeMap;

use machine::MachineFile;
use metrology::Axis;
use nalgebra::DVector;
use twin::effects::{Effect, Kind};
use twin::{Channel, Session, Twin};

use crate::config::GapConfig;
use crate::judgement::cause::{self, Found, Member, Scope};
use crate::judgement::guard;
use crate::judgement::unknown::{self, Leftover};
use crate::noise::Noise;
use crate::noise::form_error::{self, FormError};
use crate::noise::stack::{Shared, Stack};
use crate::scatter::{self, Scattered};
use crate::search::families::{self, Slot};
use crate::search::resolved;
use crate::search::signature::Begins;
use crate::search::widening;
use crate::session::changes::moved::Moved;
use crate::session::changes::{self, Change};
use crate::session::thermal_floats::{self, ThermalFloat};
use crate::shrink::split::{self, Split};

/// What every stack is made of.
pub(crate) struct Base<'a> {
    pub(crate) machine: &'a MachineFile,
    pub(crate) session: &'a Session,
    pub(crate) twin: &'a Twin<'a>,
    pub(crate) stations: usize,
    pub(crate) noise: &'a BTreeMap<Channel, Noise>,
    pub(crate) residual: &'a [Vec<f64>],
    /// The effects that the machine file has.
    pub(crate) listed: Vec<Box<dyn Effect>>,
    /// First runs after what changed in the session.
    pub(crate) begins: Vec<Begins>,
    /// What changed between repeats of the session.
    pub(crate) changes: Vec<Change>,
    /// Zero and set-up of each run as recorded.
    pub(crate) set_ups: Vec<[u32; 2]>,
    /// Whether all that was read are positions at targets.
    pub(crate) is_of_targets: bool,
    /// What is taken out of logs.
    pub(crate) floats: Vec<ThermalFloat>,
    /// What was touched and moved for itself.
    pub(crate) moved: Vec<Moved>,
}

impl<'a> Base<'a> {
    /// The same with what floats in the logs of the runs that are fitted, and whether these are positions at targets.
    pub(crate) fn floating(mut self, config: &GapConfig) -> Self {
        let fitted = split::split(self.session, config.hold_out).fit;
        let stack = self.stack(&fitted, self.noise, &FormError::base(config));
        self.floats = thermal_floats::of(&stack);
        let mut axes = Axis::LINEAR.into_iter();
        let is_of_targets = axes.any(|axis| resolved::is_at_targets(&stack, axis));
        self.is_of_targets = is_of_targets && form_error::rounding_step_mm(&stack).is_none();
        self
    }

    pub(crate) fn stack(
        &self,
        runs: &[usize],
        noise: &BTreeMap<Channel, Noise>,
        form: &FormError,
    ) -> Stack<'a> {
        let mut stack = Stack::new(
            self.session,
            self.twin,
            runs,
            self.stations,
            noise,
            &form.at_targets(self.is_of_targets),
            self.residual,
        );
        stack.events_s = changes::events_s(self.session, &self.changes).into();
        let of_logs = self.floats.iter().map(|float| float.column(&stack));
        let of_touches = self.moved.iter().map(|moved| moved.column(&stack));
        let floats = of_logs.chain(of_touches).collect();
        stack.floating(floats)
    }

    /// Searches some runs twice: once with the form error that every simulator has, then with what the effects
    /// found add to it, and with the noise of channels whose repeats show too little of it.
    fn searched(
        &self,
        runs: &[usize],
        kinds: &[&'static Kind],
        config: &GapConfig,
    ) -> Searched<'a> {
        let base = FormError::base(config);
        let listed: Vec<&dyn Effect> = self.listed.iter().map(|effect| &**effect).collect();
        let (listed, base) = if listed.is_empty() {
            (None, base)
        } else {
            let stack = self.stack(runs, self.noise, &base);
            let listed = stack.simulate(&listed);
            let nothing = vec![0.0; stack.rows.len];
            let form = FormError::beside(&stack, &listed, &nothing, config);
            (Some(listed), form)
        };
        let shared = Shared::default();
        let stack = self.stack(runs, self.noise, &base).sharing(&shared);
        let first = self.search(stack, self.noise, kinds, config);
        let told = told(&first.stack, first.found.members.iter(), &first.found);
        let rest = less(&first.stack.raw, &told);
        let inflation = guard::inflation(&first.stack, &first.slots, self.noise, rest, &base);
        let worse = |channel: &Channel| !guard::reproduces(channel, &inflation, config);
        if first.found.members.is_empty() && !inflation.keys().any(worse) {
            return Searched { inflation, ..first };
        }
        let scaled = |(channel, noise): (&Channel, &Noise)| {
            let ratio = if worse(channel) {
                inflation[channel]
            } else {
                1.0
            };
            (channel.clone(), noise.scaled(ratio))
        };
        let noise: BTreeMap<Channel, Noise> = self.noise.iter().map(scaled).collect();
        let listed = listed.unwrap_or_else(|| vec![0.0; told.len()]);
        // Rounded alike, repeats do not show the form.
        let formed = if self.is_of_targets {
            first.of_their_own_form()
        } else {
            told
        };
        let form = FormError::beside(&first.stack, &listed, &formed, config);
        let stack = self.stack(runs, &noise, &form).sharing(&shared);
        let second = self.search(stack, &noise, kinds, config);
        Searched {
            before: first.before,
            inflation,
            ..second
        }
    }

    /// The search for effects of the mean, then of scatter; where these are found the first once more, each row
    /// with the scatter that it is now known to have.
    pub(crate) fn explained(
        &self,
        split: &Split,
        kinds: &[&'static Kind],
        config: &GapConfig,
    ) -> (Searched<'a>, Scattered) {
        let searched = self.searched(&split.fit, kinds, config);
        let scope = |stack, slots| Scope {
            stack,
            slots,
            noise: &searched.noise,
            config,
            begins: &self.begins,
        };
        let of_scatter = |left: &DVector<f64>| {
            let scope = scope(&searched.stack, &searched.slots);
            scatter::find(&scope, kinds, left)
        };
        let scattered = of_scatter(&searched.found.left);
        if !scattered.is_named() {
            return (searched, scattered);
        }
        let stack = searched.stack.weighed(&scattered.spread);
        let slots = families::families(&stack);
        let found = cause::find(&scope(&stack, &slots), kinds);
        let scattered = of_scatter(&found.left.component_mul(&scattered.spread));
        if !scattered.is_named() {
            return (searched, scattered);
        }
        let again = Searched {
            stack,
            slots,
            found,
            ..searched
        };
        (again, scattered)
    }

    /// Effects of scatter that what the effects of the mean leave unexplained cannot imitate.
    pub(crate) fn scattered_within(
        &self,
        searched: &Searched<'a>,
        kinds: &[&'static Kind],
        config: &GapConfig,
    ) -> Scattered {
        let scope = Scope {
            stack: &searched.stack,
            slots: &searched.slots,
            noise: &searched.noise,
            config,
            begins: &self.begins,
        };
        scatter::find_within(&scope, kinds, &searched.found.left)
    }

    fn search(
        &self,
        stack: Stack<'a>,
        noise: &BTreeMap<Channel, Noise>,
        kinds: &[&'static Kind],
        config: &GapConfig,
    ) -> Searched<'a> {
        let slots = families::families(&stack);
        let scope = Scope {
            stack: &stack,
            slots: &slots,
            noise,
            config,
            begins: &self.begins,
        };
        let before = unknown::leftover(&stack, &slots, noise, &stack.z, &[], config);
        let found = cause::find(&scope, kinds);
        Searched {
            stack,
            slots,
            before,
            found,
            noise: noise.clone(),
            inflation: BTreeMap::new(),
        }
    }
}

/// What a search was made of and what it found.
pub(crate) struct Searched<'a> {
    pub(crate) stack: Stack<'a>,
    pub(crate) slots: Vec<Slot>,
    /// Scores before any effect.
    pub(crate) before: Leftover,
    pub(crate) found: Found,
    /// The noise that it was made with.
    pub(crate) noise: BTreeMap<Channel, Noise>,
    pub(crate) inflation: BTreeMap<Channel, f64>,
}

impl Searched<'_> {
    /// What the rows would show of the members whose form is the catalogue's. What is read at targets only has the form that the
    /// targets show: a position error there, and a lost motion, are off in size but not in form.
    fn of_their_own_form(&self) -> Vec<f64> {
        let has_form = |member: &&Member| {
            let instance = self.found.instance(member);
            !OF_TARGETS.contains(&instance.kind.id)
                || widening::axis_at_targets(&self.stack, instance).is_none()
        };
        let members = self.found.members.iter().filter(has_form);
        told(&self.stack, members, &self.found)
    }
}

/// Effects that are a number at each target and side. A straight line is not: its form is the catalogue's, and other lines have theirs.
const OF_TARGETS: [&str; 2] = ["backlash", "pitch_error"];

/// What the rows would show of some members, mm.
pub(crate) fn told<'m>(
    stack: &Stack<'_>,
    members: impl Iterator<Item = &'m Member>,
    found: &Found,
) -> Vec<f64> {
    let effects: Vec<Box<dyn Effect>> = members
        .map(|member| found.instance(member).effect(&member.estimate.values))
        .collect();
    let effects: Vec<&dyn Effect> = effects.iter().map(|effect| &**effect).collect();
    stack.simulate(&effects)
}

pub(crate) fn less(raw: &[f64], told: &[f64]) -> Vec<f64> {
    raw.iter().zip(told).map(|(raw, told)| raw - told).collect()
}
