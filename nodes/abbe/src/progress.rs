//! The live display of a run: a bar on a terminal, a line per step elsewhere.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use metrology::Axis;
use metrology::sample::PlanStatus;
use metrology::stamp::{Host, Span, Stamp};

use crate::evidence::Evidence;

/// Time between two looks of a person.
const PERIOD: Duration = Duration::from_millis(120);
const UNITS: u64 = 1000;

/// What is shown while a run goes on.
pub struct Progress {
    bar: Option<ProgressBar>,
    start: Stamp<Host>,
    shown_at: Instant,
    activity: String,
}

impl Progress {
    /// Begins at `start` of the run's own time.
    pub fn new(title: &str, start: Stamp<Host>) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(UNITS);
            let style = ProgressStyle::with_template("{prefix}\n[{bar:40}] {percent:>3} %  {msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_prefix(title.to_owned());
            bar
        });
        if bar.is_none() {
            eprintln!("{title}");
        }
        Self {
            bar,
            start,
            shown_at: Instant::now(),
            activity: String::new(),
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
        let line = numbers(now - self.start, status, evidence);
        match &self.bar {
            Some(bar) => {
                let steps = f64::from(status.steps.max(1));
                let done = (f64::from(status.step.max(1) - 1) + status.progress) / steps;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a share of a small number"
                )]
                bar.set_position((done.clamp(0.0, 1.0) * UNITS as f64) as u64);
                bar.set_message(line);
            }
            None if self.activity != status.activity => eprintln!("{line}"),
            None => {}
        }
        self.activity.clone_from(&status.activity);
    }

    /// Takes the bar away.
    pub fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Clock, activity and the latest estimates on one line.
fn numbers(elapsed: Span, status: &PlanStatus, evidence: &Evidence) -> String {
    let minutes = elapsed.nanos() / 60_000_000_000;
    let mut line = format!(
        "{:02}:{:02} h  {}/{} {}",
        minutes / 60,
        minutes % 60,
        status.step,
        status.steps,
        status.activity
    );
    if let Some(latency) = evidence.latencies.last() {
        line.push_str(&format!("  T {:.3} ms", latency.latency_s * 1e3));
    }
    if let Some(model) = evidence.models.last() {
        for axis in Axis::LINEAR {
            if let Some(drift) = &model.axes[axis] {
                line.push_str(&format!("  d{axis} {:+.1}", drift.k0_mm * 1e3));
            }
        }
        line.push_str(" µm");
    }
    if let Some(compensation) = &evidence.compensation {
        let largest_mm = compensation
            .axes
            .iter()
            .map(|a| compensation.total[a].abs())
            .fold(0.0, f64::max);
        line.push_str(&format!("  compensating {:.1} µm", largest_mm * 1e3));
    }
    line
}
