//! Laser files of Renishaw's programs: `.rtl` (linear) and `.rta` (angles), text.
//!
//! # Form
//!
//! ```text
//!   HEADER::         File type  : rtl      Owner, Version no
//!   TARGET DATA::    Filetype, Target-count: N, Targets : N numbers over lines of five, Flags: f0 f1 ..
//!   USER-TEXT::      Machine, Serial No, Date, By, Axis, Location, TITLE
//!   RUNS::           Run-count: passes
//!   DEVIATIONS::     Run Target Data: lines of pass, target from 1, deviation
//!   EQUIPMENT::
//!   ENVIRONMENT::    Air temp, Mat temp 1 .. 3, Exp coeff (begin, end), Date Time  : "10:46 Dec 12 2016" ..
//!   EOF::
//! ```
//!
//! | quantity | unit in `rtl` | unit in `rta` |
//! |---|---|---|
//! | targets | mm | deg |
//! | deviations, measured minus target | µm | mrad |
//!
//! A pass lists its targets as they were reached: the side of approach follows from their order. `f1` is 1 for a test from
//! one side, whose passes back are zeros.
//!
//! # From where
//! No description by the maker was found, and no file with a licence. The form is that on which these public programs agree,
//! each read for it: Paolico/AxisCorection (RtlParser.java, RtlEnvironment.java), StoneWolfCJQ/LinearCalc (RENISHAW.cs),
//! HunterRowley-PI/ReadLaserPlot_Test (ReadLaserPlot.py), and four readers and a writer in repositories of control makers.
//! The unit mrad is the factor 206.26 arcsec of two of them; `f1` is that of the writer alone.
//!
//! # Not read
//! Step cycles (a pass that goes to and fro), straightness, pitch and yaw.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use metrology::Axis;

use super::laser_conditions;
use super::laser_owner;
use super::laser_passes::{self, Passes, Reading, is_empty};
use super::sheet::{Cells, MOST_CELLS, Sheet};

/// Most targets of a file.
const MOST_TARGETS: usize = 100_000;
/// Columns of the table that is made.
const COLUMNS: usize = 5;

/// Whether a text is a file of runs at targets.
pub fn is_one(text: &str) -> bool {
    is_renishaw(text) && text.lines().any(|line| line.trim() == "TARGET DATA::")
}

/// Whether a text is the begin of a dynamic capture.
pub fn is_dynamic(text: &str) -> bool {
    is_renishaw(text) && text.lines().any(|line| line.trim() == "Data:")
}

fn is_renishaw(text: &str) -> bool {
    text.trim_start().starts_with("HEADER::")
}

/// The table of a file.
///
/// # Errors
/// Names the line that is damaged, the count that does not fit, or the kind of measurement that is no positioning test.
pub fn cells(text: &str) -> Result<Cells> {
    let file = File::read(text)?;
    let kind = file.kind()?;
    let mut passes = file.passes()?;
    let mut remarks = file.one_way(&mut passes);
    let run_count = file.count("RUNS", "run-count")?.map(|(_, n)| n);
    let (left_out, n_lost_runs) = laser_passes::leave_out(&mut passes, run_count);
    remarks.extend(left_out);
    if let Kind::Linear = kind {
        remarks.extend(laser_passes::doubt_unit(&passes));
    }
    remarks.extend(file.doubt_axis());
    let recorded = |key: &str| file.value("ENVIRONMENT", key);
    remarks.extend(laser_conditions::in_words(recorded));
    let axis = file.axis().map_or("", Axis::letter);
    let units = match kind {
        Kind::Linear => ["Target [mm]", "Deviation [µm]"],
        Kind::Rotary => ["Target [deg]", "Deviation [mrad]"],
    };
    let head = ["Run", "Direction", units[0], units[1], "Axis"];
    let mut lines = vec![(file.data_line, head.map(str::to_owned).to_vec())];
    for (number, pass) in &passes {
        let way = laser_passes::way_of(*number, pass)?;
        lines.extend(pass.iter().map(|one| {
            let [target, deviation] = [one.target, one.deviation].map(|value| value.to_string());
            let cells = [
                number.to_string(),
                way.to_owned(),
                target,
                deviation,
                axis.to_owned(),
            ];
            (one.line, cells.to_vec())
        }));
    }
    if axis.is_empty() {
        lines
            .iter_mut()
            .for_each(|(_, cells)| cells.truncate(COLUMNS - 1));
    }
    let sheet = Sheet {
        lines,
        ..Sheet::default()
    };
    Ok(Cells {
        sheet,
        remarks,
        n_lost_runs,
        start_s: laser_conditions::start_s([
            recorded("date time"),
            file.value("USER-TEXT", "date"),
        ]),
        ..Cells::default()
    })
}

/// What was measured at the targets.
#[derive(Clone, Copy)]
enum Kind {
    Linear,
    Rotary,
}

/// What a file holds.
#[derive(Default)]
struct File {
    /// Values by section and key, in lower case, with their lines.
    values: BTreeMap<(String, String), (u64, String)>,
    targets: Vec<f64>,
    /// Line, number of the pass, of the target, and deviation.
    readings: Vec<(u64, u32, usize, f64)>,
    /// Line of the heading of the readings.
    data_line: u64,
    has_end: bool,
}

impl File {
    fn read(text: &str) -> Result<Self> {
        let mut file = Self::default();
        let (mut section, mut is_list) = (String::new(), false);
        for (number, line) in (1..).zip(text.lines()) {
            let line =
                line.trim_matches(|letter: char| letter.is_whitespace() || letter.is_control());
            if line.is_empty() {
                continue;
            }
            if let Some(name) = line.strip_suffix("::") {
                (section, is_list) = (name.trim().to_uppercase(), false);
                file.has_end |= section == "EOF";
                continue;
            }
            let key = line
                .split_once(':')
                .map(|(key, value)| (key.trim().to_lowercase(), value.trim()));
            match (section.as_str(), key) {
                ("TARGET DATA", Some((key, value))) if key == "targets" => {
                    is_list = true;
                    file.add_targets(value)
                        .with_context(|| format!("line {number}"))?;
                }
                ("DEVIATIONS", Some((key, _))) if key == "run target data" => {
                    (is_list, file.data_line) = (true, number);
                }
                (_, Some((key, value))) => {
                    is_list = false;
                    let known = (number, value.to_owned());
                    file.values.entry((section.clone(), key)).or_insert(known);
                }
                ("TARGET DATA", None) if is_list => {
                    file.add_targets(line)
                        .with_context(|| format!("line {number}"))?;
                }
                ("DEVIATIONS", None) if is_list => {
                    file.add_reading(line, number)
                        .with_context(|| format!("line {number}"))?;
                }
                _ => {}
            }
        }
        file.check()?;
        Ok(file)
    }

    fn add_targets(&mut self, line: &str) -> Result<()> {
        for word in line.split_whitespace() {
            if self.targets.len() == MOST_TARGETS {
                bail!("more than {MOST_TARGETS} targets, the most that is read");
            }
            self.targets.push(number(word, "a target")?);
        }
        Ok(())
    }

    fn add_reading(&mut self, line: &str, at: u64) -> Result<()> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [pass, target, deviation] = words.as_slice() else {
            bail!("{line:?}: must be the numbers of run and target and the deviation");
        };
        if self.readings.len() >= MOST_CELLS / COLUMNS {
            bail!(
                "more than {} readings, the most that is read",
                MOST_CELLS / COLUMNS
            );
        }
        let pass = pass
            .parse()
            .ok()
            .with_context(|| format!("{pass:?}: is no number of a run"))?;
        let target = target
            .parse()
            .ok()
            .with_context(|| format!("{target:?}: is no number of a target"))?;
        let deviation = number(deviation, "a deviation")?;
        self.readings.push((at, pass, target, deviation));
        Ok(())
    }

    /// Compares the counts with what there is.
    fn check(&self) -> Result<()> {
        let targets = self.count("TARGET DATA", "target-count")?;
        let runs = self.count("RUNS", "run-count")?;
        if let Some((line, n)) = targets
            && n != self.targets.len()
        {
            bail!(
                "line {line}: Target-count is {n}, and {} targets are listed: a part of the file is missing",
                self.targets.len()
            );
        }
        if self.readings.is_empty() {
            bail!("no reading under DEVIATIONS:: Run Target Data: a part of the file is missing");
        }
        let n_targets = self.targets.len();
        for (line, pass, target, _) in &self.readings {
            if *target == 0 || *target > n_targets {
                bail!("line {line}: target {target}: must be from 1 to {n_targets}");
            }
            if let Some((_, n)) = runs
                && (*pass == 0 || *pass as usize > n)
            {
                bail!("line {line}: run {pass}: must be from 1 to {n}, the Run-count");
            }
        }
        if let Some((line, n)) = runs
            && !self.has_end
            && self.readings.len() < n.saturating_mul(n_targets)
        {
            bail!(
                "line {line}: {n} runs of {n_targets} targets, and {} readings before the file ends without EOF:: : a part of the file is missing",
                self.readings.len()
            );
        }
        Ok(())
    }

    fn count(&self, section: &str, key: &str) -> Result<Option<(u64, usize)>> {
        let Some((line, value)) = self.values.get(&(section.to_owned(), key.to_owned())) else {
            return Ok(None);
        };
        let n = value
            .parse()
            .ok()
            .with_context(|| format!("line {line}: {key} is {value:?}: must be a whole number"))?;
        Ok(Some((*line, n)))
    }

    fn value(&self, section: &str, key: &str) -> &str {
        let value = self.values.get(&(section.to_owned(), key.to_owned()));
        value.map_or("", |(_, value)| value)
    }

    /// Linear or rotary; everything else is no positioning test.
    fn kind(&self) -> Result<Kind> {
        let named = self.value("HEADER", "file type").to_lowercase();
        let owner = self.value("HEADER", "owner").to_lowercase();
        laser_owner::check(&owner, named == "rtl")?;
        let is_linear = named == "rtl" || (named.is_empty() && owner.contains("linear"));
        match (is_linear, self.axis()) {
            (true, Some(axis)) if !axis.is_linear() => bail!(
                "a file of lengths (rtl), and its axis is {axis}: correct \"Axis:\" under USER-TEXT::"
            ),
            (true, _) => Ok(Kind::Linear),
            (false, _) if named != "rta" => bail!(
                "File type is {named:?}, Owner {owner:?}: rtl (lengths) and rta (a rotary axis) are read"
            ),
            (false, Some(axis)) if axis.is_linear() => bail!(
                "angles along the linear axis {axis} (pitch or yaw) are no positioning test, and are not read"
            ),
            (false, None) if !owner.contains("rotary") => bail!(
                "a file of angles (rta) that names no axis: enter A, B or C as \"Axis:\" under USER-TEXT::; pitch and yaw of a linear \
                 axis are not read"
            ),
            (false, _) => Ok(Kind::Rotary),
        }
    }

    /// A doubt where something was entered as the axis that names none.
    fn doubt_axis(&self) -> Option<String> {
        let entered = self.value("USER-TEXT", "axis");
        (self.axis().is_none() && !entered.is_empty()).then(|| {
            format!(
                "warning, Axis is {entered:?}, none of X, Y, Z, A, B, C: correct it under USER-TEXT::, or state the axis in a map"
            )
        })
    }

    /// The axis that was entered as a letter, such as `X` or `Axis X`.
    fn axis(&self) -> Option<Axis> {
        let text = self.value("USER-TEXT", "axis").to_uppercase();
        let words = text.split(|letter: char| !letter.is_alphanumeric());
        let mut words = words.filter(|word| !matches!(*word, "" | "AXIS" | "ACHSE"));
        let axis = words.next()?.parse().ok()?;
        words.next().is_none().then_some(axis)
    }

    fn passes(&self) -> Result<Passes> {
        let mut passes = Passes::new();
        for (line, pass, target, deviation) in &self.readings {
            let at = target
                .checked_sub(1)
                .and_then(|place| self.targets.get(place));
            let reading = Reading {
                line: *line,
                target: *at.with_context(|| format!("line {line}: no target {target}"))?,
                deviation: *deviation,
            };
            passes.entry(*pass).or_default().push(reading);
        }
        Ok(passes)
    }

    /// Leaves out the return passes of a test from one side. Returns a doubt where all passes go one way and the flags state two.
    fn one_way(&self, passes: &mut Passes) -> Vec<String> {
        let flags: Vec<&str> = self
            .value("TARGET DATA", "flags")
            .split_whitespace()
            .collect();
        let is_up = |pass: &Vec<Reading>| match (pass.first(), pass.last()) {
            (Some(first), Some(last)) => last.target > first.target,
            _ => false,
        };
        match flags.get(1) {
            Some(&"1") if passes.values().any(|pass| !is_empty(pass)) => {
                let n = passes.len();
                passes.retain(|_, pass| !is_empty(pass));
                let left_out = n - passes.len();
                let words =
                    format!("a test from one side: {left_out} passes of zeros alone are left out");
                (left_out > 0).then_some(words).into_iter().collect()
            }
            Some(&"0") if passes.len() > 1 => {
                let first = passes.values().next().is_some_and(is_up);
                let is_one_way = passes.values().all(|pass| is_up(pass) == first);
                let words = "warning, every pass lists its targets in one order, and the file is of a test from both sides: they are taken as passes from one side";
                is_one_way.then(|| words.to_owned()).into_iter().collect()
            }
            _ => vec![],
        }
    }
}

fn number(word: &str, what: &str) -> Result<f64> {
    let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
    number.with_context(|| format!("{word:?}: is no number, where {what} must stand"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two targets, a pass each way; made, with the spaces and ends of lines of the programs.
    const MADE: &str = "HEADER::\r\nFile type  : rtl\r\nOwner      : Linear\r\nVersion no : V20.02.02\r\n\r\nTARGET DATA::\r\nFiletype  : ISO\r\nTarget-count: 3\r\nTargets :\r\n-50.000000 0.000000 \r\n70.500000 \r\nFlags: 0 0 2 0\r\n\r\nUSER-TEXT::\r\nMachine: made\r\nDate:2026-01-05 08:00:00\r\nAxis:Axis Y\r\n\r\nRUNS::\r\nRun-count:2\r\n\r\nDEVIATIONS::\r\nRun Target Data: \r\n1   1      0.5\r\n1   2      -1.25\r\n1   3      2\r\n2   3      3.5\r\n2   2      1\r\n2   1      0.75\r\n\r\nEQUIPMENT::\r\nLaser: made\r\n\r\nENVIRONMENT::\r\nAir temp   : 21.400000 21.520000 0\r\nMat temp 2 : -10.000000 -10.000000 0\r\nExp coeff  : 11.000000 11.000000 0\r\nDate Time  : \"10:46 Dec 12 2016\" \"11:01 Dec 12 2016\"\r\n\r\nEOF::\r\n";

    fn refused(text: &str) -> String {
        format!("{:#}", cells(text).map(|cells| cells.sheet).unwrap_err())
    }

    fn rows(text: &str) -> Vec<String> {
        let cells = cells(text).unwrap();
        let rows = cells.sheet.lines.iter().skip(1);
        rows.map(|(line, cells)| format!("{line}: {}", cells.join(" ")))
            .collect()
    }

    #[test]
    fn a_file_gives_its_readings_with_their_lines_targets_and_directions() {
        assert_eq!(
            rows(MADE),
            [
                "24: 1 up -50 0.5 Y",
                "25: 1 up 0 -1.25 Y",
                "26: 1 up 70.5 2 Y",
                "27: 2 down 70.5 3.5 Y",
                "28: 2 down 0 1 Y",
                "29: 2 down -50 0.75 Y",
            ]
        );
        let cells = cells(MADE).unwrap();
        assert_eq!(
            cells.sheet.lines[0].1[2..4],
            ["Target [mm]", "Deviation [µm]"]
        );
        // 2016-12-12 10:46:00 UTC.
        assert_eq!(cells.start_s, Some(1_481_539_560.0));
        let [said] = &cells.remarks[..] else {
            panic!("{:?}", cells.remarks);
        };
        assert!(
            said.contains("air 21.40 to 21.52 °C, expansion 11.00 to 11.00 µm/(m K):"),
            "{said}"
        );
    }

    #[test]
    fn targets_that_descend_turn_the_directions_round() {
        let turned = MADE.replace("-50.000000 0.000000 ", "80.000000 75.0 ");
        assert_eq!(rows(&turned)[0], "24: 1 down 80 0.5 Y");
        assert_eq!(rows(&turned)[3], "27: 2 up 70.5 3.5 Y");
    }

    #[test]
    #[expect(clippy::too_many_lines, reason = "a table of cases")]
    fn damaged_files_are_refused_with_line_and_value() {
        for (from, to, words) in [
            (
                "Target-count: 3",
                "Target-count: 4",
                "line 8: Target-count is 4, and 3 targets are listed",
            ),
            (
                "Target-count: 3",
                "Target-count: x",
                "line 8: target-count is \"x\": must be a whole number",
            ),
            (
                "70.500000 ",
                "70.5o ",
                "line 11: \"70.5o\": is no number, where a target must stand",
            ),
            (
                "1   2      -1.25",
                "1   2      inf",
                "line 25: \"inf\": is no number, where a deviation must stand",
            ),
            (
                "1   2      -1.25",
                "1   2 ",
                "line 25: \"1   2\": must be the numbers of run and target and the deviation",
            ),
            (
                "1   2      -1.25",
                "1   4  -1.25",
                "line 25: target 4: must be from 1 to 3",
            ),
            (
                "1   2      -1.25",
                "3   2  -1.25",
                "line 25: run 3: must be from 1 to 2, the Run-count",
            ),
            (
                "1   2      -1.25",
                "-1   2  -1.25",
                "line 25: \"-1\": is no number of a run",
            ),
            (
                "1   2      -1.25",
                "1   1  -1.25",
                "line 25: run 1 goes to and fro",
            ),
            (
                "Run Target Data: ",
                "Data:",
                "no reading under DEVIATIONS::",
            ),
            (
                "File type  : rtl\r\nOwner      : Linear",
                "File type  : rts\r\nOwner      : Straightness",
                "Owner is \"straightness\": straight is no positioning test",
            ),
            (
                "File type  : rtl\r\nOwner      : Linear",
                "File type  : rts\r\nOwner      : other linear",
                "File type is \"rts\", Owner \"other linear\": rtl",
            ),
            (
                "Axis:Axis Y",
                "Axis: C",
                "a file of lengths (rtl), and its axis is C",
            ),
            (
                "File type  : rtl",
                "File type  : rta",
                "angles along the linear axis Y",
            ),
        ] {
            let text = MADE.replacen(from, to, 1);
            assert_ne!(text, MADE, "{from}");
            let said = refused(&text);
            assert!(said.contains(words), "{said}");
        }
        let cut = MADE.split("2   2").next().unwrap();
        let said = refused(cut);
        assert!(
            said.contains(
                "line 20: 2 runs of 3 targets, and 4 readings before the file ends without EOF::"
            ),
            "{said}"
        );
        // The file of a measurement that was broken off is whole; its short pass is left out.
        let short = MADE.replace("2   2      1\r\n2   1      0.75\r\n", "");
        assert_eq!(rows(&short).len(), 3);
    }

    #[test]
    fn every_prefix_and_every_spoilt_letter_is_read_or_refused() {
        let letters: Vec<char> = MADE.chars().collect();
        for k in 0..letters.len() {
            let prefix: String = letters[..k].iter().collect();
            let _ = cells(&prefix);
            for odd in ['\0', ':', '9', '-', '\n', 'é'] {
                let mut spoilt = letters.clone();
                spoilt[k] = odd;
                let _ = cells(&spoilt.into_iter().collect::<String>());
            }
        }
    }

    #[test]
    fn a_test_from_one_side_loses_its_passes_of_zeros_and_a_doubtful_one_is_warned_of() {
        let zeros = MADE
            .replace("Flags: 0 0", "Flags: 0 1")
            .replace("3.5", "0")
            .replace("2   2      1\r", "2   2      0\r")
            .replace("0.75", "0");
        assert_eq!(rows(&zeros).len(), 3);
        let said = &cells(&zeros).unwrap().remarks[0];
        assert!(
            said.contains("1 passes of zeros alone are left out"),
            "{said}"
        );
        let all_up = MADE
            .replace("2   3      3.5", "2   1      3.5")
            .replace("2   1      0.75", "2   3      0.75");
        let said = &cells(&all_up).unwrap().remarks[0];
        assert!(
            said.starts_with("warning, every pass lists its targets in one order"),
            "{said}"
        );
    }

    #[test]
    fn a_rotary_file_is_in_degrees_and_milliradians() {
        let rotary = MADE.replace("rtl", "rta").replace("Axis:Axis Y", "Axis:C");
        let cells = cells(&rotary).unwrap();
        assert_eq!(
            cells.sheet.lines[0].1[2..4],
            ["Target [deg]", "Deviation [mrad]"]
        );
        let unnamed = rotary.replace("Axis:C", "Axis:");
        assert!(refused(&unnamed).contains("a file of angles (rta) that names no axis"));
        let unnamed = unnamed.replace("Linear", "Rotary");
        assert_eq!(super::cells(&unnamed).unwrap().sheet.lines[0].1.len(), 4);
        let odd = MADE.replace("Axis:Axis Y", "Axis:W");
        let said = super::cells(&odd).unwrap().remarks.join("\n");
        assert!(said.contains("Axis is \"W\", none of X, Y, Z"), "{said}");
    }

    #[test]
    fn counts_are_no_room_that_is_taken_beforehand() {
        let text = MADE.replace("Target-count: 3", "Target-count: 18446744073709551615");
        assert!(refused(&text).contains("and 3 targets are listed"));
        let text = MADE.replace("Run-count:2", "Run-count:18446744073709551615");
        assert_eq!(rows(&text).len(), 6);
        let long = format!(
            "HEADER::\nTARGET DATA::\nTargets :\n{}",
            "1 ".repeat(MOST_TARGETS + 1)
        );
        assert!(refused(&long).contains("more than 100000 targets"));
    }
}
