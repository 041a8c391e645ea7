//! `abbe import-shift LOG`: a logged shift of an MTConnect machine as part programs that load another one alike.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use clap::Args;
use machine::MachineFile;
use metrology::stamp::{Machine, Stamp};
use metrology::{Axis, PerAxis};
use mtconnect_bridge::mapping::{MapFile, Mapping};
use mtconnect_bridge::observation::read_stamp;
use mtconnect_bridge::shift::{self, ShiftOrder};
use serde::Deserialize;

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
struct OrderFile {
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

fn text(path: &PathBuf) -> Result<String> {
    std::fs::read_to_string(path).with_context(|| path.display().to_string())
}

fn stamp(key: &str, text: &str) -> Result<Stamp<Machine>> {
    read_stamp(text).with_context(|| format!("{key}: \"{text}\" is no stamp"))
}

impl OrderFile {
    fn checked(&self, machine: &MachineFile) -> Result<ShiftOrder> {
        let (from, to) = (stamp("from", &self.from)?, stamp("to", &self.to)?);
        ensure!(from < to, "to: must be after from");
        let times = [("bin_s", self.bin_s), ("slice_s", self.slice_s)];
        for (key, time_s) in times {
            ensure!(
                (1.0..=86_400.0).contains(&time_s),
                "{key} = {time_s}: must be from 1 to 86400"
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
        let machine = MachineFile::parse(&text(&self.machine)?, &place(&self.machine))?;
        let file: OrderFile =
            serde_saphyr::from_str(&text(&self.order)?).with_context(|| place(&self.order))?;
        let order = file.checked(&machine).with_context(|| place(&self.order))?;
        let map = MapFile::from_yaml(&text(&self.map)?).with_context(|| place(&self.map))?;
        let mapping = Mapping::new(&map).with_context(|| place(&self.map))?;
        let log = text(&self.log)?;
        let bins = shift::bins(log.lines(), &mapping, &order).with_context(|| place(&self.log))?;
        let programs = shift::programs(&bins, &file.title, &order)?;
        std::fs::create_dir_all(&self.output).with_context(|| place(&self.output))?;
        for (n, program) in programs.iter().enumerate() {
            let path = self.output.join(format!("shift_{n:02}.ngc"));
            std::fs::write(&path, program).with_context(|| place(&path))?;
        }
        tell!("{}: {} programs", self.output.display(), programs.len());
        Ok(ExitCode::SUCCESS)
    }
}
