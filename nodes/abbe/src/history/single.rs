//! One figure of one machine over time: trend, change points, limits.

use anyhow::Result;
use history::{
    ChangePoint, Crossing, Kept, Limit, Point, SURE, Series, Side, Store, Trend, Window, YEAR_S,
    change_points, crossing, since_last_change,
};
use reports::plot::{self, Band, Plot, Trace};
use reports::screen::Tile;
use reports::section::{Drawing, Rows, Section, head};
use serde_json::{Value, json};

use super::dates::{DAY_S, date, time};
use super::numbers::{Shown, shown, title};
use super::view::Line;

/// Most rows of the table; the plot and the JSON have all values.
const MOST_ROWS: usize = 50;
/// Most points of the plot.
const MOST_MARKS: usize = 2_000;
/// Factor of the expanded uncertainty of a step.
const COVERAGE_FACTOR: f64 = 2.0;
/// Scatter over uncertainty from which it is remarked.
const SCATTERED: f64 = 2.0;
/// Spans ahead from which a date is remarked as far.
const FAR: f64 = 1.0;

/// The evaluation of a series.
struct Evaluated {
    points: Vec<Point>,
    changes: Vec<ChangePoint>,
    /// After the last sure change.
    trend: Option<Trend>,
    shown: Shown,
}

impl Evaluated {
    fn of(series: &Series, kept: &[Kept]) -> Self {
        let points: Vec<Point> = kept.iter().map(|one| one.point).collect();
        let changes = change_points(&points);
        let trend = Trend::of(since_last_change(&points, &changes));
        Self {
            points,
            changes,
            trend,
            shown: shown(series),
        }
    }
}

/// A series as a section, for machines, and as values.
///
/// # Errors
/// When the store cannot be read, or the plot not drawn.
pub fn of(
    store: &Store,
    series: &Series,
    window: Window,
    limits: &[Limit],
) -> Result<(Section, Value, Vec<Line>)> {
    let kept = store.points(series.id, window)?;
    let evaluated = Evaluated::of(series, &kept);
    let mut section = Section::new(title(series));
    section.lines.extend(summary(&evaluated));
    section.lines.extend(trend_line(&evaluated));
    let shown = &evaluated.shown;
    section.lines.extend(
        evaluated
            .changes
            .iter()
            .map(|change| change_line(change, shown)),
    );
    let mut crossings = Vec::new();
    for limit in limits {
        // A limit is stated in the unit that is shown.
        let kept_limit = Limit {
            value: limit.value / shown.factor,
            ..*limit
        };
        let found = evaluated
            .trend
            .as_ref()
            .map(|trend| crossing(trend, kept_limit));
        section.lines.push(limit_line(*limit, found, shown));
        crossings.push(limit_json(kept_limit, found));
    }
    // The limits decide; without them the trend.
    let n_limits = limits.len();
    let decides = match n_limits {
        0 => trend_line(&evaluated).into_iter().next(),
        n => section.lines.get(section.lines.len() - n).cloned(),
    };
    section.answers.extend(decides);
    section.tile = tile(&section.title, &evaluated);
    section.tables.push(rows(&kept, shown));
    if evaluated.points.len() > 1 {
        section.drawings.push(drawing(series, &evaluated, limits)?);
    }
    let json = as_json(series, &kept, &evaluated, &crossings);
    let line = |one: Kept| Line {
        series: series.clone(),
        point: one.point,
        status: one.status,
        source: one.source,
    };
    Ok((section, json, kept.into_iter().map(line).collect()))
}

/// The last value with U, and its change per year.
fn tile(title: &str, evaluated: &Evaluated) -> Option<Tile> {
    let last = evaluated.points.last()?;
    let shown = &evaluated.shown;
    let half_width = COVERAGE_FACTOR * last.standard_uncertainty.unwrap_or(0.0);
    let trend = evaluated.trend.as_ref().map_or_else(String::new, |trend| {
        let slope = shown.with_half_width(
            trend.slope_per_s * YEAR_S,
            trend.slope_half_width_per_s() * YEAR_S,
        );
        format!("; {slope} per year (95 %)")
    });
    let more = format!("last value, of {} (k = 2){trend}", date(last.at_s));
    Some(Tile::new(
        title,
        shown.with_half_width(last.value, half_width),
        more,
    ))
}

fn summary(evaluated: &Evaluated) -> Option<String> {
    let (first, last) = (evaluated.points.first()?, evaluated.points.last()?);
    let half_width = COVERAGE_FACTOR * last.standard_uncertainty.unwrap_or(0.0);
    Some(format!(
        "Values: {} from {} to {}; the last is {}.",
        evaluated.points.len(),
        date(first.at_s),
        date(last.at_s),
        evaluated.shown.with_half_width(last.value, half_width)
    ))
}

fn trend_line(evaluated: &Evaluated) -> Vec<String> {
    let is_anew = evaluated.changes.iter().any(|change| change.chance >= SURE);
    let since = if is_anew {
        " since the last sure change"
    } else {
        ""
    };
    let Some(trend) = &evaluated.trend else {
        return vec![format!(
            "No trend{since} before more data: it needs three values at different times."
        )];
    };
    let shown = &evaluated.shown;
    let slope = shown.with_half_width(
        trend.slope_per_s * YEAR_S,
        trend.slope_half_width_per_s() * YEAR_S,
    );
    let verdict = if trend.is_significant() {
        "Trend"
    } else {
        "No significant trend"
    };
    let mut lines = vec![format!(
        "{verdict}{since}: {slope} per year (95 %, {} values); chance in noise alone {}.",
        trend.n,
        in_percent(trend.p_value)
    )];
    if let Some(ratio) = trend.birge_ratio.filter(|ratio| *ratio > SCATTERED) {
        lines.push(format!(
            "The values scatter {ratio:.1} times more than their uncertainties: something besides the measurement varies. The interval has that scatter."
        ));
    }
    lines
}

/// A probability with two decimals of a percent.
fn in_percent(chance: f64) -> String {
    const LEAST: f64 = 1e-4;
    if chance < LEAST {
        return "below 0.01 %".to_owned();
    }
    format!("{:.2} %", chance * 100.0)
}

fn change_line(change: &ChangePoint, shown: &Shown) -> String {
    let half_width = COVERAGE_FACTOR * change.standard_uncertainty;
    format!(
        "Change between {} and {} by {}, with a chance of {:.1} %; with 95 % between {} and {}.",
        date(change.before_s),
        date(change.after_s),
        shown.with_half_width(change.step, half_width),
        change.chance * 100.0,
        date(change.earliest_s),
        date(change.latest_s)
    )
}

fn limit_line(limit: Limit, found: Option<Crossing>, shown: &Shown) -> String {
    let side = match limit.side {
        Side::Upper => "upper",
        Side::Lower => "lower",
    };
    let name = format!("The {side} limit of {} {}", limit.value, shown.unit);
    match found {
        None => format!("{name}: no date before more data, there is no trend."),
        Some(Crossing::Reached) => format!("{name} is reached: the trend is at or beyond it."),
        Some(Crossing::MovesAway) => format!("{name}: the trend leads away from it."),
        Some(Crossing::NeedsData { not_before_s: None }) => {
            format!("{name}: no date before more data, the trend is not significant.")
        }
        Some(Crossing::NeedsData {
            not_before_s: Some(at_s),
        }) => format!(
            "{name}: no date before more data, the trend is not significant; not before {} (95 %).",
            date(at_s)
        ),
        Some(Crossing::Expected {
            at_s,
            earliest_s,
            latest_s,
            spans_ahead,
        }) => {
            let far = if spans_ahead > FAR {
                format!(
                    " That is {spans_ahead:.1} times the recorded span ahead, if the trend continues."
                )
            } else {
                String::new()
            };
            format!(
                "{name} is expected on {}, between {} and {} (95 %).{far}",
                date(at_s),
                date(earliest_s),
                date(latest_s)
            )
        }
    }
}

fn rows(kept: &[Kept], shown: &Shown) -> Rows {
    let left_out = kept.len().saturating_sub(MOST_ROWS);
    let row = |one: &Kept| {
        let Point {
            at_s,
            value,
            standard_uncertainty: u,
        } = one.point;
        vec![
            date(at_s),
            shown.value(value, u),
            shown.expanded(u),
            one.status.clone(),
            one.source.clone(),
        ]
    };
    let unit = if shown.unit.is_empty() {
        "1"
    } else {
        &shown.unit
    };
    let value = format!("value / {unit}");
    Rows {
        head: head(&["date", &value, "± U (k = 2)", "status", "source"]),
        rows: kept.iter().skip(left_out).map(row).collect(),
        note: if left_out > 0 {
            format!(
                "The last {MOST_ROWS} of {} values; --csv has all.",
                kept.len()
            )
        } else {
            String::new()
        },
    }
}

fn drawing(series: &Series, evaluated: &Evaluated, limits: &[Limit]) -> Result<Drawing> {
    let Evaluated { points, shown, .. } = evaluated;
    let first_s = points.first().map_or(0.0, |point| point.at_s);
    let last_s = points.last().map_or(0.0, |point| point.at_s);
    let day = |at_s: f64| (at_s - first_s) / DAY_S;
    let every = points.len().div_ceil(MOST_MARKS);
    let trace = |name: &str, points: Vec<(f64, f64)>, marks| Trace {
        name: name.to_owned(),
        points,
        marks,
    };
    let mark = |point: &Point| (day(point.at_s), point.value * shown.factor);
    let mut bands = Vec::new();
    let mut traces = vec![trace(
        "values",
        points.iter().step_by(every).map(mark).collect(),
        true,
    )];
    if let Some(trend) = &evaluated.trend {
        let along = |offset: f64| {
            let at = |k: u32| {
                let at_s = trend.first_s + f64::from(k) / 30.0 * (trend.last_s - trend.first_s);
                let value = trend.value_at(at_s) + offset * trend.half_width_at(at_s);
                (day(at_s), value * shown.factor)
            };
            (0..=30).map(at).collect::<Vec<_>>()
        };
        let ends = along(-1.0).into_iter().zip(along(1.0));
        bands.push(Band {
            name: "95 % of the trend".to_owned(),
            of: traces.len(),
            points: ends.map(|((at, low), (_, high))| (at, low, high)).collect(),
        });
        traces.push(trace("trend", along(0.0), false));
    }
    for limit in limits {
        let ends = [0.0, day(last_s)].map(|at| (at, limit.value));
        traces.push(trace("limit", ends.to_vec(), false));
    }
    let unit = if shown.unit.is_empty() {
        "1"
    } else {
        &shown.unit
    };
    let plot = Plot {
        x: format!("days since {}", date(first_s)),
        y: format!("{} / {unit}", series.name),
        traces,
    };
    let svg = plot::banded_svg(&plot, &bands)?;
    Ok(Drawing {
        svg,
        caption: "Each value, and the trend since the last sure change with its 95 % interval."
            .to_owned(),
    })
}

fn limit_json(limit: Limit, found: Option<Crossing>) -> Value {
    let mut json = json!({
        "value": limit.value,
        "side": match limit.side { Side::Upper => "upper", Side::Lower => "lower" },
    });
    let (verdict, more) = match found {
        None => ("needs_data", json!({})),
        Some(Crossing::Reached) => ("reached", json!({})),
        Some(Crossing::MovesAway) => ("moves_away", json!({})),
        Some(Crossing::NeedsData { not_before_s }) => (
            "needs_data",
            json!({ "not_before": not_before_s.map(time) }),
        ),
        Some(Crossing::Expected {
            at_s,
            earliest_s,
            latest_s,
            spans_ahead,
        }) => (
            "expected",
            json!({ "at": time(at_s), "earliest": time(earliest_s), "latest": time(latest_s), "spans_ahead": spans_ahead }),
        ),
    };
    json["verdict"] = verdict.into();
    for (key, value) in more.as_object().into_iter().flatten() {
        json[key] = value.clone();
    }
    json
}

fn as_json(series: &Series, kept: &[Kept], evaluated: &Evaluated, limits: &[Value]) -> Value {
    let point = |one: &Kept| {
        json!({
            "time": time(one.point.at_s), "value": one.point.value,
            "standard_uncertainty": one.point.standard_uncertainty,
            "status": one.status, "source": one.source,
        })
    };
    let change = |change: &ChangePoint| {
        json!({
            "before": time(change.before_s), "after": time(change.after_s),
            "earliest": time(change.earliest_s), "latest": time(change.latest_s),
            "step": change.step, "standard_uncertainty": change.standard_uncertainty,
            "chance": change.chance,
        })
    };
    let trend = evaluated.trend.as_ref().map(|trend| {
        json!({
            "values": trend.n, "first": time(trend.first_s), "last": time(trend.last_s),
            "value_at_last": trend.value_at(trend.last_s),
            "half_width_at_last": trend.half_width_at(trend.last_s),
            "slope_per_year": trend.slope_per_s * YEAR_S,
            "slope_half_width_per_year": trend.slope_half_width_per_s() * YEAR_S,
            "p_value": trend.p_value, "significant": trend.is_significant(),
            "birge_ratio": trend.birge_ratio,
        })
    });
    json!({
        "machine": series.machine, "test": series.test, "figure": series.name,
        "axis": series.axis, "unit": series.unit,
        "values": kept.iter().map(point).collect::<Vec<_>>(),
        "trend": trend,
        "changes": evaluated.changes.iter().map(change).collect::<Vec<_>>(),
        "limits": limits,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chance_is_never_nothing() {
        assert_eq!(in_percent(0.61008), "61.01 %");
        assert_eq!(in_percent(3e-9), "below 0.01 %");
    }
}
