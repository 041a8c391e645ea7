//! `abbe import-shift LOG`: a logged shift of an MTConnect machine as part programs that load another one alike.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, ensure};
use clap::Args;
use machine::MachineFile;
use metrology::stamp::{Machine, Stamp};
use metrology::{Axis, PerAxis, yaml};
use mtconnect_bridge::BridgeError;
use mtconnect_bridge::condition::words;
use mtconnect_bridge::mapping::{MapFile, Mapping};
use mtconnect_bridge::observation::read_stamp;
use mtconnect_bridge::shift::{self, Shift, ShiftOrder};
use node_runtime::text_file;
use serde::Deserialize;

use node_runtime::complain;

use crate::loss;
use crate::tell::tell;

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

fn text(path: &std::path::Path) -> Result<String> {
    Ok(text_file::yaml(path)?)
}

fn machine_file(path: &std::path::Path) -> Result<MachineFile> {
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
    /// The order, checked against the machine.
    ///
    /// # Errors
    /// With the key, its value and its limits.
    pub fn checked(&self, machine: &MachineFile) -> Result<ShiftOrder> {
        let (from, to) = (stamp("from", &self.from)?, stamp("to", &self.to)?);
        ensure!(from < to, "to: must be after from");
        let times = [("bin_s", self.bin_s), ("slice_s", self.slice_s)];
        for (key, time_s) in times {
            ensure!(
                (1.0..=86_400.0).contains(&time_s),
                "{key} = {time_s} s: must be from 1 to 86400 s"
            );
        }
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
            feed_limit_mm_min = linear.feed_limit_mm_min.min(feed_limit_mm_min);
        }
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
        })
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
        for (n, program) in programs.iter().enumerate() {
            let path = self.output.join(format!("shift_{n:02}.ngc"));
            std::fs::write(&path, program).with_context(|| place(&path))?;
        }
        tell!("{}: {} programs", self.output.display(), programs.len());
        self.account(&shift, &order);
        Ok(loss::exit_code(shift.is_whole))
    }

    /// What of the log is not in the programs, where there is something.
    fn account(&self, shift: &Shift, order: &ShiftOrder) {
        if shift.is_whole {
            return;
        }
        let log = self.log.display();
        let covered: Vec<String> = shift.covered.iter().map(between).collect();
        complain!(
            "{log}: of {}, the log tells of {}",
            between(&(order.from, order.to)),
            covered.join(", ")
        );
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

/// Leaps that are named at most.
const LEAPS_SHOWN: usize = 10;

fn between((first, last): &(Stamp<Machine>, Stamp<Machine>)) -> String {
    format!("{} to {}", words(*first), words(*last))
}
