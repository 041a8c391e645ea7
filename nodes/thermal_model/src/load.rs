//! Notices that the machine's heat sources changed.
//!
//! Two signs. The slope of a sensor near the spindle, by least squares over two successive windows:
//!
//! ```text
//!   |s₂ − s₁| > limit   and   |s₂ − s₁| > 3 √(u²(s₁) + u²(s₂))                    (1)
//! ```
//!
//! with u(s) from the residuals about each line. And production itself: it begins at another feed
//! than before, or pauses for longer than a block cycle takes.

use metrology::sample::{TestKind, TestSegment};
use metrology::stamp::Span;
use metrology::{Host, Stamp};

use crate::config::LoadConfig;
use crate::temperature::Thermometers;

/// Which sign was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadChange {
    /// The sensor's slope changed by this much, K/min.
    TemperatureSlope {
        /// Change of slope, K/min.
        change_k_per_min: f64,
    },
    /// Production goes on at another feed.
    Feed {
        /// Before, mm/s.
        from_mm_s: f64,
        /// Now, mm/s.
        to_mm_s: f64,
    },
    /// Production began after a pause, or for the first time.
    Started,
    /// Production paused.
    Paused,
}

/// What production does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Production {
    Idle,
    Running { feed_mm_s: f64 },
    Interrupted { feed_mm_s: f64, since: Stamp<Host> },
}

/// Watches both signs.
#[derive(Clone, Debug)]
pub struct LoadWatch {
    sensor: Option<usize>,
    slope_limit_k_per_min: f64,
    window: Span,
    idle: Span,
    production: Production,
    quiet_until: Option<Stamp<Host>>,
}

impl LoadWatch {
    /// A watch on `sensor` (place in the machine file) and on production.
    #[must_use]
    pub fn new(config: &LoadConfig, sensor: Option<usize>) -> Self {
        Self {
            sensor,
            slope_limit_k_per_min: config.slope_change_k_per_min,
            window: Span::from_secs_f64(config.window_s),
            idle: Span::from_secs_f64(config.idle_min * 60.0),
            production: Production::Idle,
            quiet_until: None,
        }
    }

    /// Moves all instants after a step of the clock.
    pub fn shift(&mut self, by: Span) {
        if let Production::Interrupted { since, .. } = &mut self.production {
            *since += by;
        }
        self.quiet_until = self.quiet_until.map(|at| at + by);
    }

    /// Follows production.
    pub fn segment(&mut self, segment: &TestSegment) -> Option<LoadChange> {
        if segment.kind != TestKind::Production {
            return None;
        }
        let before = self.production;
        let feed_mm_s = segment.feed_mm_s;
        if segment.begin {
            self.production = Production::Running { feed_mm_s };
            return match before {
                Production::Idle => Some(LoadChange::Started),
                Production::Running {
                    feed_mm_s: from_mm_s,
                }
                | Production::Interrupted {
                    feed_mm_s: from_mm_s,
                    ..
                } => {
                    // The same program writes the same number, so any difference is a change.
                    (from_mm_s.to_bits() != feed_mm_s.to_bits()).then_some(LoadChange::Feed {
                        from_mm_s,
                        to_mm_s: feed_mm_s,
                    })
                }
            };
        }
        if let Production::Running { feed_mm_s } = before {
            self.production = Production::Interrupted {
                feed_mm_s,
                since: segment.at,
            };
        }
        None
    }

    /// Looks for a pause and for (1).
    pub fn tick(&mut self, now: Stamp<Host>, thermometers: &Thermometers) -> Option<LoadChange> {
        if let Production::Interrupted { since, .. } = self.production
            && now - since >= self.idle
        {
            self.production = Production::Idle;
            return Some(LoadChange::Paused);
        }
        let sensor = self.sensor?;
        if self.quiet_until.is_some_and(|until| now < until) {
            return None;
        }
        let middle = now - self.window;
        let (early, early_u) = slope_k_per_min(thermometers, sensor, middle - self.window, middle)?;
        let (late, late_u) = slope_k_per_min(thermometers, sensor, middle, now)?;
        let change_k_per_min = late - early;
        let significant = change_k_per_min.abs() > 3.0 * early_u.hypot(late_u);
        (significant && change_k_per_min.abs() > self.slope_limit_k_per_min).then(|| {
            // The same bend stays in the two windows until both lie behind it.
            self.quiet_until = Some(now + self.window + self.window);
            LoadChange::TemperatureSlope { change_k_per_min }
        })
    }
}

/// Slope and its standard uncertainty over one window, K/min; needs five readings.
fn slope_k_per_min(
    thermometers: &Thermometers,
    sensor: usize,
    from: Stamp<Host>,
    to: Stamp<Host>,
) -> Option<(f64, f64)> {
    let points = || {
        let readings = thermometers.between(sensor, from, to);
        readings.map(|(at, degc)| ((at - from).as_secs_f64() / 60.0, degc))
    };
    let n = points().count();
    if n < 5 {
        return None;
    }
    let count = n as f64;
    let (mean_t, mean_y) =
        points().fold((0.0, 0.0), |(t, y), p| (t + p.0 / count, y + p.1 / count));
    let (sxx, sxy) = points().fold((0.0, 0.0), |(xx, xy), (t, y)| {
        (xx + (t - mean_t).powi(2), xy + (t - mean_t) * (y - mean_y))
    });
    if sxx <= 0.0 {
        return None;
    }
    let slope = sxy / sxx;
    let residual: f64 = points()
        .map(|(t, y)| (y - mean_y - slope * (t - mean_t)).powi(2))
        .sum();
    Some((slope, (residual / (count - 2.0) / sxx).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(s: i64) -> Stamp<Host> {
        Stamp::from_nanos(s * 1_000_000_000)
    }

    fn config() -> LoadConfig {
        LoadConfig {
            sensor: "spindle_front".to_owned(),
            ..LoadConfig::default()
        }
    }

    fn segment(kind: TestKind, begin: bool, at_s: i64, feed_mm_s: f64) -> TestSegment {
        TestSegment {
            begin,
            feed_mm_s,
            completed: !begin,
            ..TestSegment::of_kind(kind, 1, at(at_s))
        }
    }

    #[test]
    fn eq1_a_bend_of_the_temperature_is_seen_once() {
        let mut thermometers = Thermometers::new(1, 600.0);
        let mut watch = LoadWatch::new(&config(), Some(0));
        let mut seen = Vec::new();
        for s in (0..1800).step_by(10) {
            let jitter = if s % 20 == 0 { 0.02 } else { -0.02 };
            let warm = if s > 900 {
                (s - 900) as f64 / 60.0
            } else {
                0.0
            };
            thermometers.add(0, at(s), 20.0 + jitter + warm);
            seen.extend(watch.tick(at(s), &thermometers).map(|change| (s, change)));
        }
        assert_eq!(seen.len(), 1, "{seen:?}");
        assert!((900..1140).contains(&seen[0].0));
    }

    #[test]
    fn a_block_cycle_is_no_pause_but_a_long_break_is() {
        let thermometers = Thermometers::new(0, 1.0);
        let mut watch = LoadWatch::new(&config(), None);
        let run = |begin, s, feed| segment(TestKind::Production, begin, s, feed);
        assert_eq!(
            watch.segment(&run(true, 0, 50.0)),
            Some(LoadChange::Started)
        );
        assert_eq!(watch.segment(&run(false, 600, 50.0)), None);
        assert_eq!(
            watch.segment(&segment(TestKind::Block, true, 601, 2.0)),
            None
        );
        assert_eq!(watch.tick(at(700), &thermometers), None);
        assert_eq!(watch.segment(&run(true, 720, 50.0)), None);
        assert_eq!(
            watch.segment(&run(true, 800, 80.0)),
            Some(LoadChange::Feed {
                from_mm_s: 50.0,
                to_mm_s: 80.0
            })
        );
        watch.segment(&run(false, 900, 80.0));
        assert_eq!(
            watch.tick(at(1200), &thermometers),
            Some(LoadChange::Paused)
        );
        assert_eq!(watch.tick(at(1300), &thermometers), None);
    }
}
