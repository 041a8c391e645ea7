//! Offset and drift of a host's clock from exchanges of stamps, how well they are known, and when a clock stepped.
//!
//! # Model
//!
//! The line is that of the fast messages (`fast`) among the exchanges of the last `window`. Its uncertainty
//!
//! ```text
//!   u² = s_8² / 8 + (q r / 2)² / 3,     u(drift) = s_8(drift) / √8                    (5)
//!   |c - o(t)| ≤ (r_k - r) / 2 + step + 3 u                                           (6)
//! ```
//!
//! s_8 is the standard deviation of the same estimate from each eighth of the exchanges, taken in turn. r is the fast
//! round trip, q the share of it by which its two ways may differ (`asymmetry_share`): nothing that is measured says
//! it.
//!
//! An exchange with round trip r_k and middle c that waited longer than the fastest can be off by half of that,
//! whichever way waited. One that contradicts the estimate by more, (6), is doubted; three in a row, all to one side,
//! are a step of one of the clocks, and all exchanges before are forgotten.
//!
//! # Holds when
//! Both clocks run evenly over the window: a drift that bends by 1 µs/s within a minute is off by 8 µs in its middle.
//! Where no line satisfies all bounds, the older half is forgotten. A shorter route of other asymmetry looks
//! like a step and is taken for one.
//!
//! # Agreement
//! `tests/recovers.rs`, whose delays and clocks are drawn by themselves.

use std::collections::VecDeque;

use metrology::number::number;
use metrology::sample::ClockExchange;
use metrology::stamp::Span;
use metrology::{ClockMap, Host, Reference, Stamp};

use crate::band::{Band, Bound};
use crate::fast::{Line, fast_value};

/// Parts of the exchanges whose estimates are compared, (5).
const PARTS: usize = 8;
/// Exchanges in a row that contradict the estimate until it is given up.
const CONTRADICTIONS: usize = 3;
/// Coverage factor of what is no contradiction, (6).
const COVERAGE_FACTOR: f64 = 3.0;

/// What an estimate is made by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Over how long exchanges are looked at together.
    pub window: Span,
    /// Exchanges that an estimate needs.
    pub least_exchanges: usize,
    /// Greatest drift between two clocks.
    pub drift_limit: f64,
    /// q of (5).
    pub asymmetry_share: f64,
    /// What three exchanges in a row must contradict the estimate by, s.
    pub step_limit_s: f64,
}

/// Offset and drift with their uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// From the host's clock to the reference's; its instant is that of the newest exchange.
    pub map: ClockMap<Host, Reference>,
    /// u of (5), s.
    pub standard_uncertainty_s: f64,
    /// u(drift) of (5).
    pub drift_standard_uncertainty: f64,
    /// To the farther edge of the band: the offset cannot be off further, s.
    pub bound_s: f64,
    /// Of all exchanges, s.
    pub least_round_trip_s: f64,
    /// r, s.
    pub fast_round_trip_s: f64,
    /// Exchanges behind it.
    pub n: usize,
    /// Time that they cover, s.
    pub span_s: f64,
    /// The newest of them.
    pub newest: ClockExchange,
}

impl Estimate {
    /// Standard uncertainty of the offset at an instant, s.
    #[must_use]
    pub fn standard_uncertainty_at_s(&self, at: Stamp<Host>) -> f64 {
        let age_s = (at - self.map.at()).as_secs_f64();
        self.standard_uncertainty_s
            .hypot(self.drift_standard_uncertainty * age_s)
    }
}

/// What became of an exchange.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Taken {
    /// It counts.
    Used,
    /// It contradicts the estimate and does not count yet, s.
    Doubted {
        /// Its offset beyond the estimate's.
        by_s: f64,
    },
    /// One of the clocks has stepped: what was before is forgotten, s.
    Stepped {
        /// By how much the reference's clock went on more than the host's.
        by_s: f64,
    },
}

/// Why an exchange says nothing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the answer was {round_trip_s} s on its way with its question, {away_s} s after the question left and {there_s} s after it came: no time can be below 0", round_trip_s = number(*round_trip_s), away_s = number(*away_s), there_s = number(*there_s))]
pub struct Impossible {
    /// Time on the way, s.
    pub round_trip_s: f64,
    /// From question to answer by the host's clock, s.
    pub away_s: f64,
    /// The same by the reference's, s.
    pub there_s: f64,
}

/// The exchanges of a host with the reference, and what follows from them.
#[derive(Clone, Debug)]
pub struct Estimator {
    rules: Rules,
    exchanges: VecDeque<ClockExchange>,
    doubted: Vec<(ClockExchange, f64)>,
    estimate: Option<Estimate>,
}

impl Estimator {
    /// Without any exchange.
    #[must_use]
    pub const fn new(rules: Rules) -> Self {
        Self {
            rules,
            exchanges: VecDeque::new(),
            doubted: Vec::new(),
            estimate: None,
        }
    }

    /// Takes an exchange in.
    ///
    /// # Errors
    /// When its stamps cannot be.
    pub fn take(&mut self, exchange: ClockExchange) -> Result<Taken, Impossible> {
        let away = exchange.returned_at - exchange.asked_at;
        let there = exchange.answered_at - exchange.received_at;
        let round_trip = exchange.round_trip();
        if away.nanos() < 0 || there.nanos() < 0 || round_trip.nanos() < 0 {
            return Err(Impossible {
                round_trip_s: round_trip.as_secs_f64(),
                away_s: away.as_secs_f64(),
                there_s: there.as_secs_f64(),
            });
        }
        let newest = self
            .exchanges
            .back()
            .or(self.doubted.last().map(|(e, _)| e));
        if let Some(back) = newest.map(|newest| newest.returned_at - exchange.returned_at)
            && back.nanos() > 0
        {
            return Ok(self.stepped(vec![exchange], back.as_secs_f64()));
        }
        if let Some(by_s) = self.contradiction_s(&exchange) {
            return Ok(self.doubt(exchange, by_s));
        }
        self.doubted.clear();
        self.exchanges.push_back(exchange);
        let from = exchange.returned_at - self.rules.window;
        while let Some(oldest) = self.exchanges.front()
            && oldest.asked_at < from
        {
            self.exchanges.pop_front();
        }
        Ok(Taken::Used)
    }

    /// What an exchange is off by beyond (6), s.
    fn contradiction_s(&self, exchange: &ClockExchange) -> Option<f64> {
        let estimate = self.estimate?;
        let half_away = (exchange.returned_at - exchange.asked_at).nanos() / 2;
        let middle = exchange.asked_at + Span::from_nanos(half_away);
        let there = (exchange.answered_at - exchange.received_at).nanos() / 2;
        let reference = exchange.received_at + Span::from_nanos(there);
        let off_s = (reference - estimate.map.to(middle)).as_secs_f64();
        let waited_s = exchange.round_trip().as_secs_f64() - estimate.fast_round_trip_s;
        let allowed_s = waited_s.max(0.0) / 2.0
            + self.rules.step_limit_s
            + COVERAGE_FACTOR * estimate.standard_uncertainty_at_s(middle); // (6)
        (off_s.abs() > allowed_s).then_some(off_s)
    }

    fn doubt(&mut self, exchange: ClockExchange, by_s: f64) -> Taken {
        let other_side = |(_, before): &(ClockExchange, f64)| before.signum() != by_s.signum();
        if self.doubted.iter().any(other_side) {
            self.doubted.clear();
        }
        self.doubted.push((exchange, by_s));
        if self.doubted.len() < CONTRADICTIONS {
            return Taken::Doubted { by_s };
        }
        let doubted = std::mem::take(&mut self.doubted);
        self.stepped(doubted.into_iter().map(|(e, _)| e).collect(), by_s)
    }

    fn stepped(&mut self, since: Vec<ClockExchange>, by_s: f64) -> Taken {
        self.exchanges = since.into();
        self.doubted.clear();
        self.estimate = None;
        Taken::Stepped { by_s }
    }

    /// The estimate from all exchanges so far; where they are too few, the one before, if it still holds.
    pub fn estimate(&mut self) -> Option<&Estimate> {
        while self.exchanges.len() >= self.rules.least_exchanges {
            if let Some(estimate) = self.estimated() {
                self.estimate = Some(estimate);
                break;
            }
            // Not even clocks: the newer half may be.
            self.exchanges.drain(..self.exchanges.len().div_ceil(2));
        }
        self.estimate.as_ref()
    }

    /// `None`: no line satisfies every bound.
    fn estimated(&self) -> Option<Estimate> {
        let (oldest, newest) = (self.exchanges.front()?, self.exchanges.back()?);
        let origin = newest.returned_at;
        let constant = ahead(newest.received_at, newest.asked_at);
        let bounds: Vec<Bound> = self
            .exchanges
            .iter()
            .map(|exchange| bound(exchange, origin, constant))
            .collect();
        let limit = self.rules.drift_limit;
        let band = Band::widest(&bounds, limit).filter(|band| band.half_width_s >= 0.0)?;
        let line = Line::fitted(&bounds, limit)?;
        let (scatter_s, drift_scatter) = scatter(&bounds, limit);
        let round_trips_s: Vec<f64> = self
            .exchanges
            .iter()
            .map(|exchange| exchange.round_trip().as_secs_f64())
            .collect();
        let least_round_trip_s = round_trips_s.iter().copied().fold(f64::INFINITY, f64::min);
        let fast_round_trip_s = fast_value(round_trips_s)?;
        let asymmetry_s = self.rules.asymmetry_share * fast_round_trip_s / 2.0 / 3.0_f64.sqrt();
        let offset = Span::from_secs_f64(line.offset_s);
        let there = Stamp::from_nanos(origin.nanos().saturating_add(constant)) + offset;
        Some(Estimate {
            map: ClockMap::new(origin, there, line.drift),
            standard_uncertainty_s: scatter_s.hypot(asymmetry_s),
            drift_standard_uncertainty: drift_scatter,
            bound_s: band.half_width_s + (line.offset_s - band.offset_s).abs(),
            least_round_trip_s,
            fast_round_trip_s,
            n: self.exchanges.len(),
            span_s: (newest.returned_at - oldest.asked_at).as_secs_f64(),
            newest: *newest,
        })
    }
}

/// What the reference's clock shows more than the host's, ns: what an exchange is there to compare.
fn ahead(reference: Stamp<Reference>, host: Stamp<Host>) -> i64 {
    reference.nanos().saturating_sub(host.nanos())
}

/// (1) of an exchange, relative to an instant and an offset.
fn bound(exchange: &ClockExchange, origin: Stamp<Host>, constant: i64) -> Bound {
    let beyond = |ahead: i64| Span::from_nanos(ahead.saturating_sub(constant)).as_secs_f64();
    Bound {
        asked_s: (exchange.asked_at - origin).as_secs_f64(),
        most_s: beyond(ahead(exchange.received_at, exchange.asked_at)),
        returned_s: (exchange.returned_at - origin).as_secs_f64(),
        least_s: beyond(ahead(exchange.answered_at, exchange.returned_at)),
    }
}

/// Standard deviations of offset (at the origin) and drift, from those of eighths, (5).
fn scatter(bounds: &[Bound], drift_limit: f64) -> (f64, f64) {
    let parts: Vec<Line> = (0..PARTS)
        .filter_map(|part| {
            let own: Vec<Bound> = bounds.iter().skip(part).step_by(PARTS).copied().collect();
            Line::fitted(&own, drift_limit)
        })
        .collect();
    let of = |value: fn(&Line) -> f64| {
        let n = parts.len() as f64;
        let mean = parts.iter().map(value).sum::<f64>() / n;
        let squares: f64 = parts.iter().map(|p| (value(p) - mean).powi(2)).sum();
        (squares / (n - 1.0) / n).sqrt()
    };
    (of(|line| line.offset_s), of(|line| line.drift))
}
