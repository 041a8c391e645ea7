//! `abbe import-shift LOG`: a logged shift of an MTConnect machine as part programs that load another one alike.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, ensure};
use clap::Args;
use machine::MachineFile;
use metrology::bound::{Bound, BoundError};
use metrology::stamp::{Machine, Stamp};
use metrology::{Axis, PerAxis, yaml};
use mtconnect_bridge::BridgeError;
use mtconnect_bridge::condition::words;
use mtconnect_bridge::mapping::{MapFile, Mapping};
use mtconnect_bridge::observation::read_stamp;
use mtconnect_bridge::shift::{self, Shift, ShiftOrder};
use node_runtime::text_file;
use reports::loss;
use reports::whole_file;
use serde::Deserialize;

use node_runtime::complain;

use crate::tell::tell;

/// Lines of all programs: a day in seconds.
const LINES: Bound = Bound::at_most(100_000).with_remedy("; take longer bin_s or a shorter range");
/// Programs, each a file.
const PROGRAMS: Bound = Bound::at_most(1_000).with_remedy("; take longer slice_s");
/// Length of a title in bytes: it stands in a comment of every program.
const TITLE_BYTES: Bound = Bound::at_most(200);
/// An axis goes to and fro within its window: a smaller one makes a line of every hair's breadth, mm.
const LEAST_WINDOW_MM: f64 = 1.0;

/// Arguments of `abbe import-shift`.
#[derive(Args)]
pub struct ImportShift {
    /// Lines of an adapter (SHDR), as text.
    log: PathBuf,
    /// What the keys are, as `map_file` of mtconnect_bridge.
    #[arg(long)]
    map: PathBuf,
    /// Which part of the log, and where the other machine may move.
    #[arg(long)]
    order: PathBuf,
    /// Machine file of the other machine.
    #[arg(long)]
    machine: PathBuf,
    /// Folder into which `shift_00.ngc` and so on are written.
    #[arg(short, long)]
    output: PathBuf,
}

/// The order, as a person writes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrderFile {
    /// First line of every program.
    title: String,
    from: String,
    to: String,
    bin_s: f64,
    slice_s: f64,
    spindle: String,
    x_mm: (f64, f64),
    y_mm: (f64, f64),
    z_mm: (f64, f64),
    clear_mm: f64,
}

fn text(path: &Path) -> Result<String> {
    Ok(text_file::yaml(path)?)
}

fn machine_file(path: &Path) -> Result<MachineFile> {
    let file = text_file::yaml_file(path)?;
    Ok(MachineFile::parse(
        &file.text,
        &file.path.display().to_string(),
    )?)
}

fn stamp(key: &str, text: &str) -> Result<Stamp<Machine>> {
    read_stamp(text).with_context(|| format!("{key}: \"{text}\" is no stamp"))
}

impl OrderFile {
    /// Refuses an order of more lines or programs than may be written, of a length in seconds.
    fn bounded(&self, length_s: f64) -> Result<(), BoundError> {
        // It lies between 1970 and 2106: the quotients are far below the greatest number.
        let amount = |time_s: f64| (length_s / time_s).ceil() as u64;
        LINES.check_amount(
            || "bin_s".to_owned(),
            "lines from `from` to `to`",
            amount(self.bin_s),
        )?;
        PROGRAMS.check_amount(|| "slice_s".to_owned(), "programs", amount(self.slice_s))
    }

    /// Lines and programs that are whole ones.
    fn check_times(&self, range_s: f64) -> Result<()> {
        let times = [("bin_s", self.bin_s), ("slice_s", self.slice_s)];
        for (key, time_s) in times {
            ensure!(
                (1.0..=86_400.0).contains(&time_s),
                "{key} = {time_s} s: must be from 1 to 86400 s"
            );
        }
        let is_whole = |time_s: f64| {
            let lines = time_s / self.bin_s;
            lines >= 1.0 && (lines - lines.round()).abs() < 1e-9
        };
        ensure!(
            is_whole(self.slice_s),
            "slice_s = {} s: must be a whole multiple of bin_s, {} s",
            self.slice_s,
            self.bin_s
        );
        ensure!(
            is_whole(range_s),
            "to: {range_s} s from {} to {}: must be a whole multiple of bin_s, {} s",
            self.from,
            self.to,
            self.bin_s
        );
        Ok(())
    }

    /// The order, checked against the machine.
    ///
    /// # Errors
    /// With the key, its value and its limits.
    pub fn checked(&self, machine: &MachineFile) -> Result<ShiftOrder> {
        TITLE_BYTES.check_amount(|| "title".to_owned(), "bytes", self.title.len())?;
        let ends_comment = |letter: char| "()".contains(letter) || letter.is_control();
        ensure!(
            !self.title.contains(ends_comment),
            "title: must have no brackets, line ends or control characters: it stands in a comment of the programs"
        );
        let (from, to) = (stamp("from", &self.from)?, stamp("to", &self.to)?);
        ensure!(from < to, "to: must be after from");
        self.check_times((to - from).as_secs_f64())?;
        self.bounded((to - from).as_secs_f64())?;
        let windows = [self.x_mm, self.y_mm, self.z_mm];
        let mut feed_limit_mm_min = f64::INFINITY;
        for (axis, (low, high)) in Axis::LINEAR.into_iter().zip(windows) {
            let linear = machine.linear(axis);
            let linear = linear.with_context(|| format!("machine file: no axis {axis}"))?;
            let [least, greatest] = linear.travel_mm;
            ensure!(
                least <= low && low < high && high <= greatest,
                "window of {axis}: {low} to {high} mm, travel {least} to {greatest} mm"
            );
            ensure!(
                high - low >= LEAST_WINDOW_MM,
                "window of {axis}: {low} to {high} mm: at least {LEAST_WINDOW_MM} mm wide"
            );
            feed_limit_mm_min = linear.feed_limit_mm_min.min(feed_limit_mm_min);
        }
        self.check_clear(machine)?;
        let mut window_mm = PerAxis::default();
        for (axis, window) in Axis::LINEAR.into_iter().zip(windows) {
            window_mm[axis] = window;
        }
        Ok(ShiftOrder {
            from,
            to,
            bin_s: self.bin_s,
            slice_s: self.slice_s,
            spindle: self.spindle.clone(),
            window_mm,
            clear_mm: self.clear_mm,
            feed_limit_mm_s: feed_limit_mm_min / 60.0,
            spindle_limit_rpm: machine
                .spindle
                .as_ref()
                .map_or(0.0, |spindle| spindle.max_speed_rpm),
        })
    }

    /// Refuses a height of rapid motion from which the ball would come down upon what was used.
    fn check_clear(&self, machine: &MachineFile) -> Result<()> {
        let clear = machine.linear(Axis::Z).context("machine file: no axis Z")?;
        let [least, greatest] = clear.travel_mm;
        ensure!(
            (least..=greatest).contains(&self.clear_mm),
            "clear_mm = {} mm: must be within the travel of Z, {least} to {greatest} mm",
            self.clear_mm
        );
        let top = self.z_mm.1;
        ensure!(
            self.clear_mm >= top,
            "clear_mm = {} mm: must be at or above the top of z_mm, {top} mm: programs go there in G0 before X and Y move",
            self.clear_mm
        );
        Ok(())
    }
}

impl ImportShift {
    /// Writes the programs.
    ///
    /// # Errors
    /// When a file cannot be read or written, or the other machine cannot do what the log says.
    pub fn execute(self) -> Result<ExitCode> {
        let place = |path: &PathBuf| path.display().to_string();
        let machine = machine_file(&self.machine)?;
        let order_text = text(&self.order)?;
        let in_order = |error: &dyn std::fmt::Display| {
            let message = error.to_string();
            anyhow!(
                "order {}",
                yaml::placed(&place(&self.order), &order_text, &message)
            )
        };
        let file: OrderFile = yaml::read_letters(&order_text).map_err(|error| in_order(&error))?;
        let order = file
            .checked(&machine)
            .map_err(|error| in_order(&format!("{error:#}")))?;
        let map_text = text(&self.map)?;
        let in_map = |error: &dyn std::fmt::Display| {
            anyhow!(
                "map {}",
                yaml::placed(&place(&self.map), &map_text, &error.to_string())
            )
        };
        let map = MapFile::from_yaml(&map_text).map_err(|error| in_map(&error))?;
        let mapping = Mapping::new(&map).map_err(|error| in_map(&error))?;
        let log = text_file::bytes(&self.log).context("log")?;
        let shift = shift::bins(&log, &mapping, &order).map_err(|error| match error {
            BridgeError::NoSpindle { .. } => in_map(&error),
            other => anyhow::Error::from(other).context(place(&self.log)),
        })?;
        let programs = shift::programs(&shift.bins, &file.title, &order)?;
        std::fs::create_dir_all(&self.output).with_context(|| place(&self.output))?;
        write(&self.output, &programs)?;
        tell!("{}: {} programs", self.output.display(), programs.len());
        self.account(&shift, &order);
        self.warn_of_silence(&shift);
        self.warn_of_speeds(&shift);
        Ok(loss::exit_code(shift.is_whole))
    }

    /// Readings of the spindle that the programs follow although they are far from the others.
    fn warn_of_speeds(&self, shift: &Shift) {
        let log = self.log.display();
        for one in shift.doubtful.iter().take(SPEEDS_SHOWN) {
            complain!(
                "{log}: warning: spindle at {:.0} 1/min from {}; all but a hundredth of the other turning time is at most {:.0} 1/min: where the reading is false, take it out of the log",
                one.rpm,
                between(&one.during),
                one.others_rpm
            );
        }
        let more = shift.doubtful.len().saturating_sub(SPEEDS_SHOWN);
        if more > 0 {
            complain!("{log}: warning: and {more} more such readings");
        }
    }

    /// Warns of times without a line: the last logged values hold in the programs.
    fn warn_of_silence(&self, shift: &Shift) {
        let log = self.log.display();
        let named = |spans: &[(Stamp<Machine>, Stamp<Machine>)]| {
            let more = spans.len().saturating_sub(LEAPS_SHOWN);
            let shown: Vec<String> = spans.iter().take(LEAPS_SHOWN).map(between).collect();
            let more = if more > 0 {
                format!(", and {more} more")
            } else {
                String::new()
            };
            shown.join(", ") + &more
        };
        if !shift.silent.is_empty() {
            let spans = named(&shift.silent);
            complain!(
                "{log}: warning: no line from {spans}: what was logged last holds there, and axes rest"
            );
        }
        for (axis, spans) in &shift.without_position {
            let spans = named(spans);
            complain!(
                "{log}: warning: no position of {axis} from {spans}: it rests there in the programs"
            );
        }
        if !shift.not_followed.is_empty() {
            let keys = shift.not_followed.join(", ");
            complain!(
                "{log}: warning: the programs do not follow the positions of {keys}: X, Y and Z are read by `is: position`, a key for each"
            );
        }
        if !shift.without_spindle.is_empty() {
            let spans = named(&shift.without_spindle);
            complain!(
                "{log}: warning: no speed of the spindle from {spans}: it stands there in the programs"
            );
        }
    }

    /// What of the log is not in the programs, where there is something.
    fn account(&self, shift: &Shift, order: &ShiftOrder) {
        if shift.is_whole {
            return;
        }
        let log = self.log.display();
        if !shift.is_covered {
            let covered: Vec<String> = shift.covered.iter().map(between).collect();
            complain!(
                "{log}: of {}, the log covers {}",
                between(&(order.from, order.to)),
                covered.join(", ")
            );
        }
        for leap in shift.leaps.iter().take(LEAPS_SHOWN) {
            let (from, to) = (words(leap.from), words(leap.to));
            complain!("{log}: the machine's clock leaps from {from} to {to}");
        }
        let more = shift.leaps.len().saturating_sub(LEAPS_SHOWN);
        if more > 0 {
            complain!("{log}: and {more} more leaps");
        }
        complain!("{log}: {}", shift.account);
    }
}

/// Speeds that are named at most.
const SPEEDS_SHOWN: usize = 10;

/// Writes all programs or none into a folder that has none of another shift: its parts would be run with those of this one.
fn write(folder: &Path, programs: &[String]) -> Result<()> {
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    for entry in entries {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let number = name.strip_prefix("shift_");
        let number = number.and_then(|rest| rest.strip_suffix(".ngc"));
        ensure!(
            number.is_none_or(
                |number| number.is_empty() || number.contains(|c: char| !c.is_ascii_digit())
            ),
            "{}: there already, and not overwritten: {OTHER_FOLDER}",
            path.display()
        );
    }
    let named = programs.iter().enumerate();
    let files: Vec<(PathBuf, &String)> = named
        .map(|(n, program)| (folder.join(format!("shift_{n:02}.ngc")), program))
        .collect();
    let files = files
        .iter()
        .map(|(path, text)| (path.as_path(), text.as_str()));
    whole_file::create_all(files, OTHER_FOLDER)
}

const OTHER_FOLDER: &str = "name another folder with -o";

/// Leaps that are named at most.
const LEAPS_SHOWN: usize = 10;

fn between((first, last): &(Stamp<Machine>, Stamp<Machine>)) -> String {
    format!("{} to {}", words(*first), words(*last))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../launch_configs/first_run/machine.yaml");
    const ORDER: &str = include_str!("../../../launch_configs/real_shift/order.yaml");

    fn checked(text: &str) -> Result<ShiftOrder> {
        let machine = MachineFile::parse(MACHINE, "machine.yaml")?;
        yaml::read_letters::<OrderFile>(text)?.checked(&machine)
    }

    #[test]
    fn every_number_and_text_of_an_order_has_its_bound() {
        assert!(checked(ORDER).is_ok(), "{:#}", checked(ORDER).unwrap_err());
        let year = "to: \"2096-11-29T15:15:00Z\"";
        for (of, spoiled, words) in [
            ("to: \"2016-11-29T15:15:00Z\"", year, "bin_s: "),
            (
                "slice_s: 900.0",
                "slice_s: 10.0",
                "slice_s: 1440 programs: at most 1000",
            ),
            ("bin_s: 10.0", "bin_s: 0.0", "must be from 1 to 86400 s"),
            (
                "T15:15:00Z",
                "T15:15:07Z",
                "must be a whole multiple of bin_s, 10 s",
            ),
            (
                "x_mm: [-60.0, 180.0]",
                "x_mm: [-60.0, -59.9999]",
                "at least 1 mm wide",
            ),
            (
                "clear_mm: 240.0",
                "clear_mm: .nan",
                "within the travel of Z",
            ),
            (
                "clear_mm: 240.0",
                "clear_mm: 1.0e300",
                "within the travel of Z",
            ),
            (
                "clear_mm: 240.0",
                "clear_mm: 199.9",
                "at or above the top of z_mm, 200 mm",
            ),
            ("clear_mm: 240.0", "clear_mm: -50.0", "clear_mm = -50 mm"),
            ("clear_mm: 240.0", "clear_mm: 70.0", "clear_mm = 70 mm"),
            (
                "title: a shift",
                "title: a) G0 Z-60 (shift",
                "title: must have no brackets",
            ),
            (
                "title: a shift",
                "title: \"a\\nG0 Z-60\" #",
                "title: must have no brackets",
            ),
        ] {
            let text = ORDER.replacen(of, spoiled, 1);
            assert_ne!(text, ORDER, "{of}");
            let refused = format!("{:#}", checked(&text).expect_err(spoiled));
            assert!(refused.contains(words), "{spoiled}: {refused}");
        }
    }

    #[test]
    fn programs_are_written_all_or_none_and_never_over_or_beside_others() {
        let folder = tempfile::tempdir().unwrap();
        let programs = ["a\n".to_owned(), "b\n".to_owned()];
        std::fs::write(folder.path().join("shift_notes.ngc"), "mine").unwrap();
        write(folder.path(), &programs).unwrap();
        for there in ["shift_00.ngc", "shift_05.ngc"] {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join(there), "old").unwrap();
            let refused = format!("{:#}", write(folder.path(), &programs).unwrap_err());
            for words in [there, "not overwritten", "-o"] {
                assert!(refused.contains(words), "{refused}");
            }
            let left = std::fs::read_dir(folder.path()).unwrap().count();
            assert_eq!(left, 1);
            assert_eq!(std::fs::read(folder.path().join(there)).unwrap(), b"old");
        }
    }
}
