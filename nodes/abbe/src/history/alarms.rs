//! Limits of figures: which a machine exceeds, in words, for machines, for `/diagnostics` and for a webhook.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use abbe_msgs::diagnostic_msgs::msg::DiagnosticStatus;
use anyhow::{Context, Result, anyhow};
use clap::Args;
use history::{
    Crossing, Figure, Limit, Point, Series, SeriesKey, Side, Store, Trend, Window, change_points,
    crossing, since_last_change,
};
use node_runtime::{complain, text_file};
use reports::Report;
use reports::evaluate::limits::Limits;
use reports::evaluate::limits::alarms::{Judged, Observed, State};
use reports::evaluate::limits::of_axis;
use reports::screen::{Tile, Tone};
use reports::section::{Rows, Section, head};
use reports::terminal::Rank;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::dates::{date, time};
use super::numbers::{shown, title};
use super::webhook::{Patience, post};

/// Exit code of a figure that exceeds its limits.
const EXCEEDED: u8 = 4;
/// Name and version of what a webhook gets.
const ALARM_SCHEMA: &str = "abbe.alarm/1";
/// What made an alarm.
const MADE_BY: &str = concat!("abbe ", env!("CARGO_PKG_VERSION"));
/// Alarms that are named one by one; more are counted.
const MOST_NAMED: usize = 10;

/// The limits of verbs that have no other use for them.
#[derive(Args, Clone, Debug, Default)]
pub struct LimitsOption {
    /// Limits that the kept figures are held against (limits.yaml): exit code 4 and an alarm for each that exceeds its own.
    #[arg(long, value_name = "FILE", requires = "keep")]
    limits: Option<PathBuf>,
}

impl LimitsOption {
    /// Reads the limits, where there are some.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn open(&self) -> Result<Option<Limits>> {
        self.limits.as_deref().map(read).transpose()
    }

    /// The file, where one is named.
    pub fn path(&self) -> Option<&Path> {
        self.limits.as_deref()
    }
}

/// Reads limits.
///
/// # Errors
/// When the file cannot be read, with key, value and remedy.
pub fn read(path: &Path) -> Result<Limits> {
    let text = text_file::yaml(path).context("limits file")?;
    Limits::read(&text, path)
}

/// The end of a verb that kept figures and held them against limits: the alarms are raised whether or not they could be kept.
///
/// # Errors
/// When the figures could not be kept, or the receiver of alarms did not take them.
pub fn ended(alarms: Option<&Alarms>, kept: Result<()>, code: ExitCode) -> Result<ExitCode> {
    let Some(alarms) = alarms else {
        return kept.map(|()| code);
    };
    let raised = alarms.raise();
    if let (Err(_), Err(error)) = (&kept, &raised) {
        complain!("abbe: {error:#}");
    }
    kept.and(raised)?;
    Ok(alarms.code(code))
}

/// A figure and where it stands.
struct Row {
    series: Series,
    point: Point,
    source: String,
    judged: Judged,
    /// When its trend reaches a limit.
    expected: String,
}

/// Figures that were held against their limits.
pub struct Alarms {
    rows: Vec<Row>,
    unused: Vec<String>,
    limits: Limits,
}

/// What is judged before it is kept.
pub struct Measured<'m> {
    /// The machine's name.
    pub machine: &'m str,
    /// Time of the measurement, s since 1970.
    pub at_s: f64,
    /// Path of the bag.
    pub source: &'m str,
    /// Its figures.
    pub figures: &'m [Figure],
}

impl Alarms {
    /// Judges the figures of a report or a diagnosis.
    ///
    /// # Errors
    /// When a limit is of another unit than its figure.
    pub fn of_figures(limits: Limits, measured: &Measured<'_>) -> Result<Self> {
        let mut rows = Vec::new();
        for figure in measured.figures {
            let series = Series {
                id: 0,
                machine: measured.machine.to_owned(),
                test: figure.test.clone(),
                name: figure.name.clone(),
                axis: figure.axis.clone(),
                unit: figure.unit.clone(),
            };
            let point = Point {
                at_s: measured.at_s,
                value: figure.value,
                standard_uncertainty: figure.standard_uncertainty,
            };
            rows.extend(judged(&limits, series, point, measured.source)?);
        }
        let mut alarms = Self::of_rows(rows, limits, Some(measured.machine));
        // A plan measures what it measures: limits of other tests are no omission.
        alarms.unused.clear();
        Ok(alarms)
    }

    /// Judges the last values of a store.
    ///
    /// # Errors
    /// When the store cannot be read, or a limit is of another unit than its figure.
    pub fn of_store(
        limits: Limits,
        store: &Store,
        key: &SeriesKey,
        window: Window,
    ) -> Result<Self> {
        let mut rows = Vec::new();
        for series in store.series(key)? {
            if !limits.has(&series.machine, &series.name, &axis_of(&series)) {
                continue;
            }
            let kept = store.points(series.id, window)?;
            let points: Vec<Point> = kept.iter().map(|one| one.point).collect();
            let Some(last) = kept.last() else { continue };
            let row = judged(&limits, series, last.point, &last.source)?;
            rows.extend(row.map(|row| Row {
                expected: expected(&row.judged, &points),
                ..row
            }));
        }
        let is_all = key.name.is_none() && key.axis.is_none() && key.test.is_none();
        let mut alarms = Self::of_rows(rows, limits, key.machine.as_deref());
        if !is_all {
            alarms.unused.clear();
        }
        Ok(alarms)
    }

    fn of_rows(mut rows: Vec<Row>, limits: Limits, machine: Option<&str>) -> Self {
        rows.sort_by_key(|row| std::cmp::Reverse(row.judged.state));
        let used: BTreeSet<String> = rows.iter().map(|row| row.judged.key.clone()).collect();
        Self {
            unused: limits.unused(machine, &used),
            rows,
            limits,
        }
    }

    fn raised(&self) -> impl Iterator<Item = &Row> {
        let rows = self.rows.iter();
        rows.filter(|row| row.judged.state == State::Alarm)
    }

    /// For a page.
    pub fn section(&self) -> Section {
        let mut section = Section::new("Limits").ranked(Rank::Answer);
        section.answers.push(self.in_short());
        for line in self.lines() {
            section.warn("Alarm", line);
        }
        let row = |row: &Row| {
            let shown = shown(&row.series);
            let Point {
                value,
                standard_uncertainty: u,
                ..
            } = row.point;
            vec![
                row.series.machine.clone(),
                title(&row.series),
                date(row.point.at_s),
                format!("{} {}", shown.value(value, u), shown.unit),
                shown.expanded(u),
                zone(row),
                row.judged.state.name().to_owned(),
                row.expected.clone(),
            ]
        };
        section.tables.push(Rows {
            head: head(&[
                "machine",
                "figure",
                "date",
                "value",
                "± U (k = 2)",
                "limits",
                "state",
                "limit expected",
            ]),
            rows: self.rows.iter().map(row).collect(),
            note: "undecided: within U of a limit. Without U the value alone decides.".to_owned(),
        });
        section.figures = self.json();
        section
    }

    fn in_short(&self) -> String {
        match (self.raised().count(), self.rows.len()) {
            (_, 0) => "no figure here has a limit.".to_owned(),
            (0, all) => format!("none of {all} figures with a limit exceeds it."),
            (n, all) => format!("ALARM: {n} of {all} figures with a limit exceed it."),
        }
    }

    /// Adds the limits to a report: their part, a tile, and the alarms to its verdict and to what failed.
    pub fn add_to(&self, report: &mut Report) {
        report.add("alarms", &self.section());
        let (n, all) = (self.raised().count(), self.rows.len());
        if all == 0 {
            return;
        }
        let screen = &mut report.screen;
        let tile =
            |value: String| Tile::new("figures with a limit", value, "the table Limits has each");
        if n == 0 {
            let tile = tile(format!("{all} of {all} within"));
            screen.tiles.insert(0, tile.toned(Tone::Good));
            return;
        }
        let tile = tile(format!("{n} of {all} exceed it"));
        screen.tiles.insert(0, tile.toned(Tone::Bad));
        screen.lacks.splice(0..0, self.lines());
        if let Some((sentence, tone)) = &mut screen.verdict {
            *sentence = format!("{} {sentence}", self.in_short());
            *tone = Tone::Bad;
        }
    }

    /// For machines.
    pub fn json(&self) -> Value {
        let state = self.rows.first().map(|row| row.judged.state.name());
        json!({
            "state": state,
            "figures": self.rows.iter().map(Row::json).collect::<Vec<_>>(),
            "without_figure": self.unused,
        })
    }

    /// A line for each alarm, up to a number, and for the limits without a figure.
    fn lines(&self) -> Vec<String> {
        let n = self.raised().count();
        let mut lines: Vec<String> = self.raised().take(MOST_NAMED).map(Row::line).collect();
        if n > MOST_NAMED {
            lines.push(format!("{} more alarms.", n - MOST_NAMED));
        }
        if !self.unused.is_empty() {
            lines.push(format!(
                "Without a figure: {}: check the names, or remove them.",
                self.unused.join(", ")
            ));
        }
        lines
    }

    /// The conditions for `/diagnostics`: each figure with a limit, so that one that is within it again is known too.
    pub fn conditions(&self, node: &str) -> Vec<DiagnosticStatus> {
        let of = |row: &Row| DiagnosticStatus {
            level: match row.judged.state {
                State::Within => DiagnosticStatus::OK,
                State::Undecided => DiagnosticStatus::WARN,
                State::Alarm => DiagnosticStatus::ERROR,
            },
            name: format!("/{node}: limit/{}", title(&row.series)),
            message: row.line(),
            hardware_id: row.series.machine.clone(),
            ..DiagnosticStatus::default()
        };
        self.rows.iter().map(of).collect()
    }

    /// Prints the alarms, and sends them where that is wanted.
    ///
    /// # Errors
    /// When the receiver did not take them.
    pub fn raise(&self) -> Result<()> {
        for line in self.lines() {
            complain!("abbe: {line}");
        }
        let webhook = self.limits.webhook().map_err(|error| anyhow!("{error}"))?;
        let Some(to) = webhook.filter(|_| self.raised().next().is_some()) else {
            return Ok(());
        };
        let alarms = Value::Array(self.raised().map(Row::json).collect());
        let id = format!("{:x}", Sha256::digest(alarms.to_string()));
        let body =
            json!({ "schema": ALARM_SCHEMA, "id": id, "software": MADE_BY, "alarms": alarms });
        complain!("abbe: sending the alarm to http://{}{}", to.host, to.path);
        let sent = post(&to, &id, &body.to_string(), Patience::default());
        sent.map(|_| ()).map_err(|reason| {
            anyhow!(
                "webhook http://{}{}: {reason}: the alarm was not delivered; the figures are as stated above",
                to.host,
                to.path
            )
        })
    }

    /// The exit code of a verb that is done, `otherwise` without an alarm.
    pub fn code(&self, otherwise: ExitCode) -> ExitCode {
        if self.raised().next().is_some() {
            ExitCode::from(EXCEEDED)
        } else {
            otherwise
        }
    }

    /// Whether every limit has a figure.
    pub const fn is_whole(&self) -> bool {
        self.unused.is_empty()
    }
}

impl Row {
    fn line(&self) -> String {
        let shown = shown(&self.series);
        let u = self.point.standard_uncertainty;
        let half_width = 2.0 * u.unwrap_or(0.0);
        let word = match self.judged.state {
            State::Within => "Within its limits",
            State::Undecided => "Undecided",
            State::Alarm => "ALARM",
        };
        format!(
            "{word}: {}: {} = {}: must be {}.",
            self.series.machine,
            title(&self.series),
            shown.with_half_width(self.point.value, half_width),
            zone(self)
        )
    }

    fn json(&self) -> Value {
        json!({
            "machine": self.series.machine, "test": self.series.test,
            "figure": self.series.name, "axis": self.series.axis, "unit": self.series.unit,
            "time": time(self.point.at_s), "value": self.point.value,
            "standard_uncertainty": self.point.standard_uncertainty,
            "lower": self.judged.lower, "upper": self.judged.upper,
            "key": self.judged.key, "state": self.judged.state.name(), "source": self.source,
        })
    }
}

/// The axis of a series: its own, or the one that its test's title names.
fn axis_of(series: &Series) -> String {
    if !series.axis.is_empty() {
        return series.axis.clone();
    }
    of_axis::named_in(&series.test).map_or(String::new(), |axis| axis.to_string())
}

fn judged(limits: &Limits, series: Series, point: Point, source: &str) -> Result<Option<Row>> {
    let axis = axis_of(&series);
    let observed = Observed {
        name: &series.name,
        axis: &axis,
        unit: &series.unit,
        value: point.value,
        standard_uncertainty: point.standard_uncertainty,
    };
    let found = limits.judge(&series.machine, &observed)?;
    Ok(found.map(|judged| Row {
        series,
        point,
        source: source.to_owned(),
        judged,
        expected: String::new(),
    }))
}

/// The limits in words, in the unit that is shown.
fn zone(row: &Row) -> String {
    let shown = shown(&row.series);
    let of = |limit: f64| shown.value(limit, None);
    match (row.judged.lower, row.judged.upper) {
        (Some(lower), Some(upper)) => format!("{} to {} {}", of(lower), of(upper), shown.unit),
        (Some(lower), None) => format!("≥ {} {}", of(lower), shown.unit),
        (_, Some(upper)) => format!("≤ {} {}", of(upper), shown.unit),
        (None, None) => String::new(),
    }
}

/// When the trend of a series reaches one of its limits; the earlier one.
fn expected(judged: &Judged, points: &[Point]) -> String {
    let Some(trend) = Trend::of(since_last_change(points, &change_points(points))) else {
        return String::new();
    };
    let limits = [(judged.lower, Side::Lower), (judged.upper, Side::Upper)];
    let dates = limits.into_iter().filter_map(|(value, side)| {
        match crossing(
            &trend,
            Limit {
                value: value?,
                side,
            },
        ) {
            Crossing::Expected { at_s, .. } => Some(at_s),
            _ => None,
        }
    });
    dates.min_by(f64::total_cmp).map(date).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use history::{Entry, Kind, Options};
    use reports::ReportKind;
    use reports::evidence::Evidence;

    use super::*;

    const LIMITS: &str = "rule: guard_band\nlimits:\n  effect.backlash.width_um: {upper_um: 10.0}\n  gap.rms: {upper_um: 9.0}\n";

    fn limits() -> Limits {
        Limits::read(LIMITS, Path::new("limits.yaml")).unwrap()
    }

    fn play(width_um: f64) -> Figure {
        Figure {
            test: "Diagnosis".to_owned(),
            name: "effect.backlash.width_um".to_owned(),
            axis: "X".to_owned(),
            value: width_um,
            unit: "um".to_owned(),
            standard_uncertainty: Some(0.1),
            interval: None,
            status: "named".to_owned(),
        }
    }

    fn measured(width_um: f64) -> Alarms {
        let figures = [play(width_um)];
        let measured = Measured {
            machine: "m",
            at_s: 86_400.0,
            source: "bag",
            figures: &figures,
        };
        Alarms::of_figures(limits(), &measured).unwrap()
    }

    #[test]
    fn a_figure_beyond_its_limit_is_an_alarm_in_words_json_condition_and_exit_code() {
        let other = ExitCode::from(3);
        for (width_um, state, level, code) in [
            (9.0, "within", DiagnosticStatus::OK, other),
            (9.9, "undecided", DiagnosticStatus::WARN, other),
            (10.1, "undecided", DiagnosticStatus::WARN, other),
            (10.3, "alarm", DiagnosticStatus::ERROR, ExitCode::from(4)),
        ] {
            let alarms = measured(width_um);
            assert_eq!(alarms.json()["state"], state, "{width_um}");
            let condition = &alarms.conditions("abbe_run")[0];
            assert_eq!(condition.level, level, "{width_um}");
            let begin = "/abbe_run: limit/effect.backlash.width_um X";
            assert!(condition.name.starts_with(begin), "{}", condition.name);
            assert_eq!(alarms.code(other), code, "{width_um}");
            let is_alarm = state == "alarm";
            assert_eq!(alarms.lines().len(), usize::from(is_alarm));
            let text = alarms.section().terminal();
            assert_eq!(text.contains("ALARM: m: "), is_alarm, "{text}");
            assert!(text.contains("≤ 10.00 µm"), "{text}");
            let mut report = Report::of(ReportKind::Tests, "t", &Evidence::default()).unwrap();
            report.screen.verdict = Some(("Smaller.".to_owned(), Tone::Good));
            alarms.add_to(&mut report);
            let (verdict, tone) = report.screen.verdict.clone().unwrap();
            assert_eq!(verdict.starts_with("ALARM: 1 of 1 "), is_alarm, "{verdict}");
            assert_eq!(tone == Tone::Bad, is_alarm);
            assert_eq!(report.screen.tiles[0].tone == Tone::Bad, is_alarm);
            assert_eq!(report.screen.lacks.len(), usize::from(is_alarm));
        }
    }

    #[test]
    fn a_figure_whose_test_names_its_axis_is_held_against_the_limits_of_the_axis() {
        let text = "rule: simple\nlimits:\n  iso230_2.accuracy: {upper_um: 20.0}\n  iso230_2.accuracy X: {upper_um: 5.0}\n";
        for (test, n_alarms) in [
            ("Positioning X: not compensated", 1),
            ("Positioning Y", 0),
            ("Circle XY", 0),
        ] {
            let figures = [Figure {
                test: test.to_owned(),
                name: "iso230_2.accuracy".to_owned(),
                axis: String::new(),
                value: 0.008,
                unit: "mm".to_owned(),
                ..play(0.0)
            }];
            let measured = Measured {
                machine: "m",
                at_s: 86_400.0,
                source: "bag",
                figures: &figures,
            };
            let limits = Limits::read(text, Path::new("limits.yaml")).unwrap();
            let alarms = Alarms::of_figures(limits, &measured).unwrap();
            assert_eq!(alarms.lines().len(), n_alarms, "{test}");
        }
    }

    #[test]
    fn the_last_value_of_a_series_counts_and_its_trend_gives_the_date_of_the_limit() {
        let home = tempfile::tempdir().unwrap();
        let mut store = Store::open(&home.path().join("s.sqlite"), Options::default()).unwrap();
        for day in 0..10_i64 {
            let entry = Entry {
                machine: "m".to_owned(),
                at_s: day * 86_400 + 1,
                kind: Kind::Diagnosis,
                sha256: format!("{day:064x}"),
                machine_sha256: None,
                source: format!("bag_{day}"),
                instruments: String::new(),
                operator: String::new(),
                software: "abbe".to_owned(),
                figures: vec![play(day as f64 * 0.5)],
            };
            store.add(&entry).unwrap();
        }
        let all = SeriesKey::default();
        let alarms = Alarms::of_store(limits(), &store, &all, Window::ALL).unwrap();
        assert_eq!(alarms.rows[0].point.value.to_bits(), 4.5_f64.to_bits());
        // 10 µm at half a µm a day.
        assert_eq!(alarms.rows[0].expected, "1970-01-21");
        assert_eq!(alarms.unused, ["limits.gap.rms"]);
        assert!(!alarms.is_whole());
        let chosen = SeriesKey {
            name: Some("effect".to_owned()),
            ..SeriesKey::default()
        };
        let alarms = Alarms::of_store(limits(), &store, &chosen, Window::ALL).unwrap();
        assert!(alarms.is_whole());
    }
}
