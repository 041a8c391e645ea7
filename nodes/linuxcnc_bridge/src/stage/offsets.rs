//! Offsets between the graph and HAL: held back until every axis is homed, told about when they fail to come.

use metrology::sample::AxisCompensation;
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Author, AuthorNews, GateNews, HomedGate, OffsetsRefused, SoleAuthor};

use crate::compensation::{CompensationPath, Freshness};
use crate::condition::Condition;
use crate::config::Settings;

/// Published offsets that have not come after this time are reported.
const FIRST_WITHIN: Span = Span::from_nanos(10_000_000_000);
/// HAL is taken to have faded every offset after this time.
const FADED_AFTER: Span = Span::from_nanos(10_000_000_000);

/// The way of offsets with its gate and its witnesses.
#[derive(Debug)]
pub(super) struct Offsets {
    path: CompensationPath,
    gate: HomedGate,
    authors: SoleAuthor,
    stale_after: Span,
    freshness: Option<Freshness>,
    refused: OffsetsRefused,
    /// When the last set was refused, until it is over.
    refused_at: Option<Stamp<Host>>,
    /// Since when, and by how many, they are published while none has come.
    awaited: Option<(Stamp<Host>, usize)>,
    has_come: bool,
    is_missed: bool,
    /// When the gate was shut, and the greatest offset of a linear axis then, mm.
    shut: Option<(Stamp<Host>, f64)>,
}

impl Offsets {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            path: CompensationPath::new(settings),
            gate: HomedGate::default(),
            authors: SoleAuthor::default(),
            stale_after: settings.compensation_stale_after,
            freshness: None,
            refused: OffsetsRefused::default(),
            refused_at: None,
            awaited: None,
            has_come: false,
            is_missed: false,
            shut: None,
        }
    }

    /// Says nothing more to HAL, which fades out what it has.
    pub(super) fn release(&mut self) {
        self.path.release();
        self.freshness = None;
        (self.awaited, self.has_come, self.is_missed) = (None, false, false);
    }

    /// HAL was started anew and knows nothing.
    pub(super) fn forget_passed(&mut self) {
        self.path.forget_passed();
        self.shut = None;
    }

    /// The offsets that come next are of this publisher, whether they can be read or not.
    pub(super) fn hears(&mut self, at: Stamp<Host>, author: Author) {
        self.authors.hear(at, author);
    }

    /// Two publishers that speak: nobody is followed.
    pub(super) fn contested(&self) -> Option<(Author, Author)> {
        self.authors.contested()
    }

    /// Takes offsets, or returns why they are refused.
    pub(super) fn receive(
        &mut self,
        at: Stamp<Host>,
        compensation: &AxisCompensation,
    ) -> Option<Condition> {
        self.has_come = true;
        if !self.authors.follows_last() {
            return None;
        }
        let fault = self.path.receive(at, compensation).err()?;
        self.refused_at = Some(at);
        let times = self.refused.count(&fault);
        Some(Condition::CompensationRefused { fault, times })
    }

    /// So many publish offsets; an inactive bridge waits for none.
    pub(super) fn publishers(&mut self, at: Stamp<Host>, publishers: usize, active: bool) {
        if publishers == 0 || !active || self.has_come {
            self.awaited = None;
            return;
        }
        let since = self.awaited.map_or(at, |(since, _)| since.min(at));
        self.awaited = Some((since, publishers));
    }

    /// Lines for HAL that are due, where it can be `reached`.
    pub(super) fn tick(
        &mut self,
        at: Stamp<Host>,
        every_axis_homed: bool,
        reached: bool,
        conditions: &mut Vec<Condition>,
    ) -> Option<String> {
        let was_open = self.gate.is_open();
        self.watch_authors(at, conditions);
        let is_contested = self.contested().is_some();
        let freshness = self.path.freshness(at).filter(|_| !is_contested);
        let news = self
            .gate
            .step(every_axis_homed, freshness == Some(Freshness::Fresh));
        if news == Some(GateNews::HeldBack) {
            conditions.push(Condition::CompensationHeld);
        }
        self.watch_homing(at, was_open, conditions);
        self.watch_freshness(freshness, news, conditions);
        self.watch_silence(at, conditions);
        self.watch_refusals(at, conditions);
        if !reached {
            return None;
        }
        self.path.due(at, self.gate.is_open())
    }

    /// While two publishers speak HAL is given zero, towards which it fades what it has; the next offsets are of one alone.
    fn watch_authors(&mut self, at: Stamp<Host>, conditions: &mut Vec<Condition>) {
        match self.authors.tick(at) {
            Some(AuthorNews::Contested(one, other)) => {
                conditions.push(Condition::CompensationContested { one, other });
            }
            Some(AuthorNews::Alone) => {
                self.path.release();
                conditions.push(Condition::CompensationUncontested);
            }
            None => {}
        }
        if self.contested().is_some() {
            self.path.want_zero(at);
        }
    }

    fn watch_homing(&mut self, at: Stamp<Host>, was_open: bool, conditions: &mut Vec<Condition>) {
        match (was_open, self.gate.is_open()) {
            (true, false) => self.shut = Some((at, self.path.greatest_passed_mm())),
            (false, true) => {
                let Some((shut_at, greatest_mm)) = self.shut.take() else {
                    return;
                };
                if greatest_mm > 0.0 && at - shut_at < FADED_AFTER {
                    conditions.push(Condition::HomedUnderOffset {
                        after_s: (at - shut_at).as_secs_f64(),
                        greatest_um: greatest_mm * 1e3,
                    });
                }
            }
            _ => {}
        }
    }

    fn watch_freshness(
        &mut self,
        freshness: Option<Freshness>,
        news: Option<GateNews>,
        conditions: &mut Vec<Condition>,
    ) {
        let changed = std::mem::replace(&mut self.freshness, freshness) != freshness;
        match freshness {
            Some(Freshness::Stale) if changed => conditions.push(Condition::CompensationStale {
                limit_s: self.stale_after.as_secs_f64(),
            }),
            Some(Freshness::Fresh)
                if self.gate.is_open() && (changed || news == Some(GateNews::PassedOn)) =>
            {
                conditions.push(Condition::CompensationFresh);
            }
            _ => {}
        }
    }

    /// Refused sets may come among good ones again and again: the condition ends after a while without one.
    fn watch_refusals(&mut self, at: Stamp<Host>, conditions: &mut Vec<Condition>) {
        let Some(refused_at) = self.refused_at else {
            return;
        };
        if at - refused_at > self.stale_after {
            self.refused_at = None;
            conditions.push(Condition::CompensationRefusedNoMore {
                limit_s: self.stale_after.as_secs_f64(),
            });
        } else {
            // The clock may be set back.
            self.refused_at = Some(refused_at.min(at));
        }
    }

    fn watch_silence(&mut self, at: Stamp<Host>, conditions: &mut Vec<Condition>) {
        let Some((since, publishers)) = self.awaited else {
            return;
        };
        if !self.is_missed && at - since > FIRST_WITHIN {
            self.is_missed = true;
            conditions.push(Condition::CompensationNeverCame {
                publishers,
                limit_s: FIRST_WITHIN.as_secs_f64(),
            });
        }
    }
}
