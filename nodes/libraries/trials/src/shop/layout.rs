//! Layouts of positioning tables, as instruments and people write them.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::positioning::Stop;

/// When every measurement begins, s since 1970.
pub const START_S: u64 = 1_767_600_000;

/// How a table of a positioning run looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Run, direction, target, deviation in µm.
    Long,
    /// Each pass with a number of its own.
    PassesAsRuns,
    /// No numbers of runs.
    NoRuns,
    /// No column of the direction.
    NoDirection,
    /// Upwards only.
    OneWay,
    /// Every target from both sides, as often as there are cycles, before the next one.
    StepCycle,
    /// A column for each pass, semicolons, decimal commas.
    Wide,
    /// Sorted by direction, target and run.
    Sorted,
    /// Measured positions in place of deviations.
    Measured,
    /// Targets that differ by up to 2 µm between passes.
    WanderingTargets,
    /// Inches.
    Inches,
    /// Tabulators, signs for directions, a preamble.
    Tabs,
}

const ALL: [(Layout, &str); 12] = [
    (Layout::Long, "run, direction, target, deviation"),
    (Layout::PassesAsRuns, "passes numbered as runs"),
    (Layout::NoRuns, "no numbers of runs"),
    (Layout::NoDirection, "no directions"),
    (Layout::OneWay, "upwards only"),
    (Layout::StepCycle, "step cycle"),
    (Layout::Wide, "a column for each pass, decimal commas"),
    (Layout::Sorted, "sorted by direction and target"),
    (Layout::Measured, "measured positions"),
    (Layout::WanderingTargets, "targets that wander by 2 µm"),
    (Layout::Inches, "inches"),
    (Layout::Tabs, "tabulators, signs, a preamble"),
];

impl Layout {
    /// Draws one, all equally often.
    pub fn draw(random: &mut Pcg64Mcg) -> Self {
        ALL[random.random_range(0..ALL.len())].0
    }

    /// In words.
    pub fn words(self) -> &'static str {
        let found = ALL.iter().find(|(layout, _)| *layout == self);
        found.map_or("", |(_, words)| words)
    }
}

/// The motion of a positioning run, for its map.
pub struct Run {
    /// The axis.
    pub axis: &'static str,
    /// Where the other axes stand, in their order, mm.
    pub others_mm: [f64; 2],
    /// Rest at a stop, s.
    pub dwell_s: f64,
    /// Feed, mm/s.
    pub feed_mm_s: f64,
    /// How far beyond an end the axis turned round, mm.
    pub overrun_mm: f64,
}

/// The table and the map of a run.
pub fn write(
    random: &mut Pcg64Mcg,
    layout: Layout,
    run: &Run,
    stops: &[Stop],
    deviations_um: &[f64],
) -> (String, String) {
    let rows: Vec<(Stop, f64)> = stops
        .iter()
        .copied()
        .zip(deviations_um.iter().copied())
        .collect();
    let (text, head, columns) = match layout {
        Layout::Wide => wide(&rows),
        Layout::Inches => inches(&rows),
        Layout::Measured => measured(&rows),
        _ => long(random, layout, &rows),
    };
    let others = { ["X", "Y", "Z"].iter() }.filter(|letter| **letter != run.axis);
    let at: Vec<String> = { others.zip(run.others_mm) }
        .map(|(letter, at_mm)| format!("{letter}: {at_mm:.1}"))
        .collect();
    let map = format!(
        "{head}start_s: {START_S}\nat_mm: {{{}}}\ntest:\n  positioning:\n    axis: {}\n    feed_mm_min: {:.1}\n    \
         dwell_s: {:.1}\n    overrun_mm: {:.1}\n{columns}",
        at.join(", "),
        run.axis,
        60.0 * run.feed_mm_s,
        run.dwell_s,
        run.overrun_mm
    );
    (text, map)
}

const fn way(is_up: bool) -> &'static str {
    if is_up { "up" } else { "down" }
}

fn keys(pairs: &[(&str, &str)]) -> String {
    let line = |(key, column): &(&str, &str)| format!("    {key}: {column}\n");
    pairs.iter().map(line).collect()
}

fn long(random: &mut Pcg64Mcg, layout: Layout, rows: &[(Stop, f64)]) -> (String, String, String) {
    let mut rows = rows.to_vec();
    if layout == Layout::Sorted {
        rows.sort_by_key(|(stop, _)| (!stop.is_up, stop.target, stop.cycle));
    }
    let [has_run, has_way] = [layout != Layout::NoRuns, layout != Layout::NoDirection];
    let is_tabs = layout == Layout::Tabs;
    let separator = if is_tabs { "\t" } else { "," };
    let mut heads = vec!["target_mm", "deviation_um"];
    if has_way {
        heads.insert(0, "direction");
    }
    if has_run {
        heads.insert(0, "run");
    }
    let mut text = String::new();
    if is_tabs {
        text += "Linear measurement\nOperator\tMB\n\n";
    }
    let decimals: usize = random.random_range(1..=3);
    text += &(heads.join(separator) + "\n");
    for (stop, deviation_um) in &rows {
        let pass = 2 * stop.cycle + usize::from(!stop.is_up);
        let run = if layout == Layout::PassesAsRuns {
            pass
        } else {
            stop.cycle
        } + 1;
        let way = match (is_tabs, stop.is_up) {
            (true, true) => "+",
            (true, false) => "-",
            (false, is_up) => way(is_up),
        };
        let mut cells = vec![
            format!("{:.3}", stop.place_mm),
            format!("{deviation_um:.decimals$}"),
        ];
        if has_way {
            cells.insert(0, way.to_owned());
        }
        if has_run {
            cells.insert(0, run.to_string());
        }
        text += &(cells.join(separator) + "\n");
    }
    let mut pairs = vec![("target_mm", "target_mm"), ("deviation_um", "deviation_um")];
    if has_way {
        pairs.push(("direction", "direction"));
    }
    if has_run {
        pairs.push(("run", "run"));
    }
    let head = if is_tabs { "separator: \"\\t\"\n" } else { "" };
    (text, head.to_owned(), keys(&pairs))
}

fn wide(rows: &[(Stop, f64)]) -> (String, String, String) {
    let passes: BTreeSet<(usize, bool)> = { rows.iter() }
        .map(|(stop, _)| (stop.cycle, !stop.is_up))
        .collect();
    let column = |(cycle, is_down): &(usize, bool)| {
        format!(
            "Run {} {} [µm]",
            cycle + 1,
            if *is_down { "↓" } else { "↑" }
        )
    };
    let heads: Vec<String> = passes.iter().map(column).collect();
    let mut text = format!("Position [mm];{}\n", heads.join(";"));
    let targets: BTreeSet<usize> = rows.iter().map(|(stop, _)| stop.target).collect();
    for target in targets {
        let of = |pass: &(usize, bool)| {
            let is_own = |(stop, _): &&(Stop, f64)| {
                stop.target == target && (stop.cycle, !stop.is_up) == *pass
            };
            rows.iter().find(is_own)
        };
        let own: Vec<&(Stop, f64)> = passes.iter().filter_map(of).collect();
        let place_mm = own.first().map_or(0.0, |(stop, _)| stop.place_mm);
        let cells: Vec<String> = own.iter().map(|(_, value)| format!("{value:.2}")).collect();
        text += &(format!("{place_mm:.3};{}", cells.join(";")).replace('.', ",") + "\n");
    }
    let mut columns = "    target_mm: \"Position [mm]\"\n    passes_um:\n".to_owned();
    for pass in &passes {
        let _ = writeln!(
            columns,
            "      - {{column: \"{}\", direction: {}}}",
            column(pass),
            way(!pass.1)
        );
    }
    (
        text,
        "separator: \";\"\ndecimal: \",\"\n".to_owned(),
        columns,
    )
}

fn inches(rows: &[(Stop, f64)]) -> (String, String, String) {
    let mut text = "run,direction,Position [inch],Error [inch]\n".to_owned();
    for (stop, deviation_um) in rows {
        let (run, inch, error) = (
            stop.cycle + 1,
            stop.place_mm / 25.4,
            deviation_um / 25_400.0,
        );
        let _ = writeln!(text, "{run},{},{inch:.6},{error:.8}", way(stop.is_up));
    }
    let units = "units: {\"Position [inch]\": inch, \"Error [inch]\": inch}\n".to_owned();
    let pairs = [
        ("run", "run"),
        ("direction", "direction"),
        ("target_mm", "\"Position [inch]\""),
        ("deviation_um", "\"Error [inch]\""),
    ];
    (text, units, keys(&pairs))
}

fn measured(rows: &[(Stop, f64)]) -> (String, String, String) {
    let mut text = "run,direction,target_mm,measured_mm\n".to_owned();
    for (stop, deviation_um) in rows {
        let (run, at_mm) = (stop.cycle + 1, stop.place_mm);
        let measured_mm = at_mm + 1e-3 * deviation_um;
        let _ = writeln!(
            text,
            "{run},{},{at_mm:.3},{measured_mm:.5}",
            way(stop.is_up)
        );
    }
    let pairs = [
        ("run", "run"),
        ("direction", "direction"),
        ("target_mm", "target_mm"),
        ("measured_mm", "measured_mm"),
    ];
    (text, String::new(), keys(&pairs))
}
