//! The touch probe's signal: when its contact opens, and when the control learns of it.
//!
//! ```text
//!   x(t) = depth of the ball behind the surface - pretravel - noise                         (1)
//!   contact at  t_c = t_0 + dt x_0 / (x_0 - x_1)  where x changes sign within the period    (2)
//!   edge at     t_e = t_c + latency + jitter,  never before the edge in front of it         (3)
//! ```
//!
//! Within a period the depth is taken as linear, which for a touch at constant feed is exact. The
//! probe counts as deflected ("closed", as the control's input sees it) from the instant when (1)
//! rises through zero until it has fallen below the release hysteresis. A touch draws one number for
//! its noise when the ball reaches the surface; jitter has its own stream.

use std::collections::VecDeque;

use metrology::stamp::Span;

use super::error::{PlantError, require_finite, require_not_negative, require_positive};
use super::file::{FaultsEntry, ProbeFaultEntry, TouchProbeEntry};
use super::noise::{Effect, Stream};

/// Edges that can be under way at once; a bounce of the greatest allowed length fits.
const EDGES_UNDER_WAY: usize = 64;
/// Most pairs of edges that a bounce may add.
const BOUNCE_PAIRS_LIMIT: u32 = 16;

/// A change of the contact itself, before any latency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    /// Since the start.
    pub(super) at: Span,
    /// Whether the stylus is deflected after it.
    pub(super) closed: bool,
}

/// Contact, transmission and faults of the probe.
#[derive(Clone, Debug)]
pub(super) struct TouchProbe {
    latency_s: f64,
    jitter_s: f64,
    repeatability_mm: f64,
    hysteresis_mm: f64,
    fault: ProbeFaultEntry,
    repeatability: Stream,
    jitter: Stream,
    bounce: Stream,
    /// (1) at the end of the last period; `None` away from every surface.
    excess_mm: Option<f64>,
    touch_noise_mm: f64,
    touching: bool,
    deflected: bool,
    under_way: VecDeque<Edge>,
    last_arrival: Span,
    /// What the control sees.
    arrived_closed: bool,
    pub(super) last_contact: Option<Edge>,
}

impl TouchProbe {
    pub(super) fn new(
        entry: &TouchProbeEntry,
        faults: &FaultsEntry,
        seed: u64,
    ) -> Result<Self, PlantError> {
        let at = |key: &str| format!("touch_probe.{key}");
        require_not_negative(at("latency_ms"), entry.latency_ms)?;
        require_not_negative(at("jitter_ms"), entry.jitter_ms)?;
        require_not_negative(at("repeatability_um"), entry.repeatability_um)?;
        require_finite(
            at("ball_radius_deviation_um"),
            entry.ball_radius_deviation_um,
        )?;
        require_not_negative(at("release_hysteresis_um"), entry.release_hysteresis_um)?;
        match faults.probe {
            ProbeFaultEntry::StuckClosed { from_s } | ProbeFaultEntry::Dead { from_s } => {
                require_not_negative("faults.probe.from_s", from_s)?;
            }
            ProbeFaultEntry::Bounce { pairs, spacing_us } => {
                require_positive("faults.probe.spacing_us", spacing_us)?;
                super::error::require(
                    (1..=BOUNCE_PAIRS_LIMIT).contains(&pairs),
                    "faults.probe.pairs",
                    f64::from(pairs),
                    "from 1 to 16",
                )?;
            }
            ProbeFaultEntry::None => {}
        }
        Ok(Self {
            latency_s: entry.latency_ms / 1e3,
            jitter_s: entry.jitter_ms / 1e3,
            repeatability_mm: entry.repeatability_um / 1e3,
            hysteresis_mm: entry.release_hysteresis_um / 1e3,
            fault: faults.probe.clone(),
            repeatability: Stream::new(seed, Effect::ProbeRepeatability, 0),
            jitter: Stream::new(seed, Effect::ProbeJitter, 0),
            bounce: Stream::new(seed, Effect::Bounce, 0),
            excess_mm: None,
            touch_noise_mm: 0.0,
            touching: false,
            deflected: false,
            under_way: VecDeque::with_capacity(EDGES_UNDER_WAY),
            last_arrival: Span::default(),
            arrived_closed: false,
            last_contact: None,
        })
    }

    pub(super) fn latency_s(&self) -> f64 {
        self.latency_s
    }

    /// The signal at the control.
    pub(super) fn closed(&self, now: Span) -> bool {
        match self.fault {
            ProbeFaultEntry::StuckClosed { from_s } if now.as_secs_f64() >= from_s => true,
            ProbeFaultEntry::Dead { from_s } if now.as_secs_f64() >= from_s => false,
            _ => self.arrived_closed,
        }
    }

    /// Nothing is near: the stylus is free.
    pub(super) fn leave(&mut self, start: Span) {
        self.excess_mm = None;
        self.touching = false;
        if self.deflected {
            self.change(start, false);
        }
    }

    /// The period from `start` ended with the ball `depth_mm` behind a surface (negative: before it)
    /// where this touch has the given pretravel.
    pub(super) fn follow(&mut self, start: Span, period_s: f64, depth_mm: f64, pretravel_mm: f64) {
        if depth_mm > 0.0 && !self.touching {
            self.touch_noise_mm = self.repeatability_mm * self.repeatability.normal();
        }
        self.touching = depth_mm > 0.0;
        let excess_mm = depth_mm - pretravel_mm - self.touch_noise_mm; // (1)
        let before_mm = self.excess_mm.unwrap_or(excess_mm);
        self.excess_mm = Some(excess_mm);
        let threshold_mm = if self.deflected {
            -self.hysteresis_mm
        } else {
            0.0
        };
        let crossed = if self.deflected {
            excess_mm < threshold_mm
        } else {
            excess_mm >= threshold_mm
        };
        if crossed {
            let change_mm = excess_mm - before_mm;
            let share = if change_mm.abs() > 0.0 {
                ((threshold_mm - before_mm) / change_mm).clamp(0.0, 1.0) // (2)
            } else {
                0.0
            };
            let at = after(start, share * period_s);
            self.change(at, !self.deflected);
        }
    }

    /// Takes the next edge that arrives before `end`.
    pub(super) fn arrive(&mut self, end: Span) -> Option<Edge> {
        let edge = *self.under_way.front()?;
        if edge.at >= end {
            return None;
        }
        self.under_way.pop_front();
        self.arrived_closed = edge.closed;
        let lost = match self.fault {
            ProbeFaultEntry::StuckClosed { from_s } | ProbeFaultEntry::Dead { from_s } => {
                edge.at.as_secs_f64() >= from_s
            }
            _ => false,
        };
        if lost { self.arrive(end) } else { Some(edge) }
    }

    fn change(&mut self, at: Span, closed: bool) {
        self.deflected = closed;
        self.last_contact = Some(Edge { at, closed });
        let delay_s = self.latency_s + self.jitter_s * self.jitter.normal();
        let mut arrival = after(at, delay_s.max(0.0)); // (3)
        self.send(arrival, closed);
        if let ProbeFaultEntry::Bounce { pairs, spacing_us } = self.fault {
            for edge in 0..2 * pairs {
                let spacing_s = spacing_us * 1e-6 * (0.5 + self.bounce.uniform());
                arrival = after(arrival, spacing_s);
                self.send(arrival, if edge % 2 == 0 { !closed } else { closed });
            }
        }
    }

    fn send(&mut self, arrival: Span, closed: bool) {
        let at = arrival.max(self.last_arrival);
        if self.under_way.len() < EDGES_UNDER_WAY {
            self.last_arrival = at;
            self.under_way.push_back(Edge { at, closed });
        }
    }
}

/// `seconds_s` after `start`.
pub(super) fn after(start: Span, seconds_s: f64) -> Span {
    Span::from_nanos(start.nanos() + Span::from_secs_f64(seconds_s).nanos())
}
