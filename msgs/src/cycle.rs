//! Orders for measuring cycles, and what the sequencer is doing.

use metrology::sample::{CycleKind, CycleOrder, PlanState, PlanStatus as Status};

use crate::action::RunCycleGoal;
use crate::msg::PlanStatus;
use crate::wire::{Allowed, Reader, metres, millimetres, time};
use crate::{Place, Wire, WireError};

const CYCLE_KINDS: [CycleKind; 6] = [
    CycleKind::Blocks,
    CycleKind::Latency,
    CycleKind::Touch,
    CycleKind::Plane,
    CycleKind::Bore,
    CycleKind::Sphere,
];

fn kind_code(kind: CycleKind) -> u8 {
    match kind {
        CycleKind::Blocks => RunCycleGoal::CYCLE_BLOCKS,
        CycleKind::Latency => RunCycleGoal::CYCLE_LATENCY,
        CycleKind::Touch => RunCycleGoal::CYCLE_TOUCH,
        CycleKind::Plane => RunCycleGoal::CYCLE_PLANE,
        CycleKind::Bore => RunCycleGoal::CYCLE_BORE,
        CycleKind::Sphere => RunCycleGoal::CYCLE_SPHERE,
    }
}

/// Feeds of programs count by the minute.
const S_PER_MIN: f64 = 60.0;

impl Wire for RunCycleGoal {
    type Inner = CycleOrder;

    fn set_from_inner(&mut self, inner: &CycleOrder) {
        self.cycle = kind_code(inner.kind);
        self.features.clone_from(&inner.features);
        self.feeds_m_s.clear();
        self.feeds_m_s.extend(
            inner
                .feeds_mm_min
                .iter()
                .map(|feed| metres(feed / S_PER_MIN)),
        );
        self.points = inner.points;
        self.repeats = inner.repeats;
        self.cold = inner.cold;
    }

    fn to_inner(&self) -> Result<CycleOrder, WireError> {
        let read = Reader::of::<Self>();
        let mut feeds_mm_min = Vec::with_capacity(self.feeds_m_s.len());
        for (idx, feed_m_s) in self.feeds_m_s.iter().enumerate() {
            let place = Place::Entry(idx);
            let feed_m_s = read.number("feeds_m_s", place, *feed_m_s, Allowed::Finite)?;
            feeds_mm_min.push(millimetres(feed_m_s) * S_PER_MIN);
        }
        Ok(CycleOrder {
            kind: read.variant("cycle", Place::Whole, self.cycle, &CYCLE_KINDS, kind_code)?,
            features: self.features.clone(),
            feeds_mm_min,
            points: self.points,
            repeats: self.repeats,
            cold: self.cold,
        })
    }
}

const PLAN_STATES: [PlanState; 4] = [
    PlanState::Waiting,
    PlanState::Running,
    PlanState::Done,
    PlanState::Failed,
];

fn state_code(state: PlanState) -> u8 {
    match state {
        PlanState::Waiting => PlanStatus::STATE_WAITING,
        PlanState::Running => PlanStatus::STATE_RUNNING,
        PlanState::Done => PlanStatus::STATE_DONE,
        PlanState::Failed => PlanStatus::STATE_FAILED,
    }
}

impl Wire for PlanStatus {
    type Inner = Status;

    fn set_from_inner(&mut self, inner: &Status) {
        self.header.stamp = time(inner.at);
        self.state = state_code(inner.state);
        self.step = inner.step;
        self.steps = inner.steps;
        self.activity.clone_from(&inner.activity);
        self.run = inner.run;
        self.progress = inner.progress;
        self.message.clone_from(&inner.message);
    }

    fn to_inner(&self) -> Result<Status, WireError> {
        let read = Reader::of::<Self>();
        Ok(Status {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            state: read.variant("state", Place::Whole, self.state, &PLAN_STATES, state_code)?,
            step: self.step,
            steps: self.steps,
            activity: self.activity.clone(),
            run: self.run,
            progress: read.finite("progress", self.progress)?,
            message: self.message.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_keeps_its_feeds_by_the_minute() {
        for kind in CYCLE_KINDS {
            let order = CycleOrder {
                kind,
                features: vec!["block_1.z".to_owned()],
                feeds_mm_min: vec![60.0, 960.0],
                points: 5,
                repeats: 3,
                cold: true,
            };
            let wire = RunCycleGoal::from_inner(&order);
            assert!((wire.feeds_m_s[1] - 0.016).abs() < 1e-15);
            let back = wire.into_inner().unwrap();
            assert!((back.feeds_mm_min[1] - 960.0).abs() < 1e-9);
            assert_eq!((back.kind, back.points), (kind, 5));
        }
    }

    #[test]
    fn an_unknown_cycle_and_an_endless_feed_are_refused_by_name() {
        let goal = RunCycleGoal {
            cycle: 9,
            ..RunCycleGoal::default()
        };
        assert!(goal.into_inner().unwrap_err().to_string().contains("cycle"));
        let goal = RunCycleGoal {
            feeds_m_s: vec![f64::NAN],
            ..RunCycleGoal::default()
        };
        let refusal = goal.into_inner().unwrap_err().to_string();
        assert!(refusal.contains("feeds_m_s[0]: NaN"), "{refusal}");
    }

    #[test]
    fn a_status_comes_back_from_the_wire() {
        for state in PLAN_STATES {
            let status = Status {
                at: metrology::Stamp::from_nanos(5),
                state,
                step: 2,
                steps: 3,
                activity: "block cycle".to_owned(),
                run: 7,
                progress: 0.5,
                message: String::new(),
            };
            assert_eq!(
                PlanStatus::from_inner(&status).into_inner().unwrap(),
                status
            );
        }
    }
}
