//! The live display of a run: a bar on a terminal, a line per step elsewhere.

use node_runtime::complain;
use reports::evidence::Evidence;

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use metrology::Axis;
use metrology::sample::PlanStatus;
use metrology::stamp::{Host, Span, Stamp};
use metrology::visible::visible;

/// Time between two looks of a person.
const PERIOD: Duration = Duration::from_millis(120);
const BAR_UNITS: u64 = 1000;

/// What is shown while a run goes on.
pub struct Progress {
    bar: Option<ProgressBar>,
    start: Stamp<Host>,
    shown_at: Instant,
    /// Steps whose begin has been said.
    said: usize,
}

impl Progress {
    /// Begins at `start` of the run's own time.
    pub fn new(title: &str, start: Stamp<Host>) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(BAR_UNITS);
            let style = ProgressStyle::with_template("{prefix}\n[{bar:40}] {percent:>3} %  {msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_prefix(visible(title).into_owned());
            bar
        });
        if bar.is_none() {
            complain!("{title}");
        }
        Self {
            bar,
            start,
            shown_at: Instant::now(),
            said: 0,
        }
    }

    /// Whether it is time to show something again.
    pub fn due(&self) -> bool {
        self.shown_at.elapsed() >= PERIOD
    }

    /// Shows where the run is.
    pub fn show(&mut self, now: Stamp<Host>, evidence: &Evidence) {
        self.shown_at = Instant::now();
        let Some(status) = &evidence.status else {
            return;
        };
        let Some(bar) = &self.bar else {
            self.say(evidence);
            return;
        };
        let steps = f64::from(status.steps.max(1));
        let done = (f64::from(status.step.max(1) - 1) + status.progress) / steps;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a small number"
        )]
        bar.set_position((done.clamp(0.0, 1.0) * BAR_UNITS as f64) as u64);
        let numbers = numbers(evidence);
        let message = format!("{}{numbers}", step(now - self.start, status));
        bar.set_message(visible(&message).into_owned());
    }

    /// A line for every step that has begun since the last call; a step may be over within one look.
    fn say(&mut self, evidence: &Evidence) {
        let Some(first) = evidence.begun.first() else {
            return;
        };
        let news = &evidence.begun[self.said.min(evidence.begun.len())..];
        for (place, status) in news.iter().enumerate() {
            let line = step(status.at - first.at, status);
            let is_last = place + 1 == news.len();
            let numbers = if is_last {
                numbers(evidence)
            } else {
                String::new()
            };
            complain!("{line}{numbers}");
        }
        self.said = evidence.begun.len();
    }

    /// Takes the bar away; says what was not said yet.
    pub fn finish(mut self, evidence: &Evidence) {
        match self.bar.take() {
            Some(bar) => bar.finish_and_clear(),
            None => self.say(evidence),
        }
    }
}

/// Clock and activity.
fn step(elapsed: Span, status: &PlanStatus) -> String {
    let minutes = elapsed.nanos() / 60_000_000_000;
    format!(
        "{:02}:{:02} h  step {} of {}: {}",
        minutes / 60,
        minutes % 60,
        status.step,
        status.steps,
        status.activity
    )
}

/// The latest estimates, behind what is done.
fn numbers(evidence: &Evidence) -> String {
    let mut parts = Vec::new();
    if let Some(latency) = evidence.latencies.last() {
        parts.push(format!("latency {:.3} ms", latency.latency_s * 1e3));
    }
    if let Some(model) = evidence.models.last() {
        let drifts = Axis::LINEAR.into_iter().filter_map(|axis| {
            let drift = model.axes[axis].as_ref()?;
            Some(format!("{axis} {:+.1}", drift.k0_mm * 1e3))
        });
        let drifts: Vec<String> = drifts.collect();
        if !drifts.is_empty() {
            parts.push(format!("drift at the origin {} µm", drifts.join(" ")));
        }
    }
    if let Some(compensation) = &evidence.compensation {
        let largest_mm = compensation
            .axes
            .iter()
            .map(|a| compensation.total[a].abs())
            .fold(0.0, f64::max);
        parts.push(format!("compensating up to {:.1} µm", largest_mm * 1e3));
    }
    if parts.is_empty() {
        String::new()
    } else {
        format!("  ({})", parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use metrology::sample::PlanState;

    use super::*;

    #[test]
    fn a_step_that_is_over_within_one_look_is_said_all_the_same() {
        let mut progress = Progress {
            bar: None,
            start: Stamp::from_nanos(0),
            shown_at: Instant::now(),
            said: 0,
        };
        let status = |step: u32| PlanStatus {
            at: Stamp::from_nanos(i64::from(step) * 60_000_000_000),
            state: PlanState::Running,
            step,
            steps: 9,
            activity: format!("activity {step}"),
            run: 0,
            progress: 0.0,
            message: String::new(),
        };
        let evidence = Evidence {
            begun: vec![status(1), status(2), status(3)],
            status: Some(status(3)),
            ..Evidence::default()
        };
        progress.show(Stamp::from_nanos(0), &evidence);
        assert_eq!(progress.said, 3);
        let line = step(Span::from_nanos(3_660_000_000_000), &status(2));
        assert_eq!(line, "01:01 h  step 2 of 9: activity 2");
    }
}
