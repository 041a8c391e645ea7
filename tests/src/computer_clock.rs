//! The realtime clock of a computer that a test makes wrong.
//!
//! Debian's `libfaketime` stands between a process and that clock. The monotonic clock goes on as it is, and so do both
//! clocks of the test.

use std::path::PathBuf;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

use metrology::stamp::{Host, Stamp};

/// The library that puts another clock under a process.
#[derive(Clone, Debug)]
pub struct Faketime(PathBuf);

impl Faketime {
    /// Where there is none the test's name and the reason are printed, and `None` tells the test to end.
    ///
    /// # Panics
    /// When there is none and `CI=true`.
    #[must_use]
    pub fn found(test: &str) -> Option<Self> {
        let folders = std::fs::read_dir("/usr/lib").unwrap();
        let mut paths =
            folders.map(|entry| entry.unwrap().path().join("faketime/libfaketimeMT.so.1"));
        let found = paths.find(|path| path.is_file());
        if found.is_none() {
            let reason = "libfaketime is not installed (tests/run installs it)";
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
            eprintln!("NOT TESTED: {test}: {reason}");
        }
        found.map(Self)
    }

    /// What a process is told that it stands under.
    fn variables(&self) -> [(&'static str, String); 2] {
        [
            ("LD_PRELOAD", self.0.display().to_string()),
            ("FAKETIME_DONT_FAKE_MONOTONIC", "1".to_owned()),
        ]
    }
}

/// A clock that is set: it adds what a file says that all its processes read at every look at the clock, so that they see a
/// step at once, as processes of one computer do.
pub struct SetClock {
    faketime: Faketime,
    file: PathBuf,
    ahead_s: i64,
}

impl SetClock {
    /// One that is right.
    ///
    /// # Panics
    /// When the file cannot be written.
    #[must_use]
    pub fn new(faketime: &Faketime, file: PathBuf) -> Self {
        let mut clock = Self {
            faketime: faketime.clone(),
            file,
            ahead_s: 0,
        };
        clock.set(0);
        clock
    }

    /// How far it is ahead of the test's, s.
    #[must_use]
    pub fn ahead_s(&self) -> i64 {
        self.ahead_s
    }

    /// Sets it this far ahead of the test's.
    ///
    /// # Panics
    /// When the file cannot be written.
    pub fn set(&mut self, ahead_s: i64) {
        let next = self.file.with_extension("next");
        std::fs::write(&next, format!("{ahead_s:+}\n")).unwrap();
        std::fs::rename(&next, &self.file).unwrap();
        self.ahead_s = ahead_s;
    }

    /// Puts it under a process that is to be started.
    pub fn put_under(&self, command: &mut Command) {
        command
            .envs(self.faketime.variables())
            .env("FAKETIME_TIMESTAMP_FILE", &self.file)
            .env("FAKETIME_NO_CACHE", "1");
    }
}

/// What a clock is made to show: the truth that what is found of it is held against.
#[derive(Clone, Copy, Debug)]
pub struct ClockError {
    /// What it shows too much at `since`, s.
    pub offset_s: f64,
    /// Seconds that it gains per second.
    pub drift: f64,
    /// When the offset is that, by the right clock.
    pub since: Stamp<Host>,
}

impl ClockError {
    /// From now on.
    ///
    /// # Panics
    /// When the clock shows a time before 1970.
    #[must_use]
    pub fn of(offset_s: f64, drift: f64) -> Self {
        let seconds = now().nanos() / 1_000_000_000;
        Self {
            offset_s,
            drift,
            since: Stamp::from_nanos(seconds * 1_000_000_000),
        }
    }

    /// What the right clock is ahead of this one when it shows `own`, s.
    #[must_use]
    pub fn true_offset_s(&self, own: Stamp<Host>) -> f64 {
        let shown_s = (own - self.since).as_secs_f64() - self.offset_s;
        -self.offset_s - self.drift * shown_s / (1.0 + self.drift)
    }

    /// What puts it under a process that is started now: a rate counts from the process' own start, which is some milliseconds
    /// later, by which a drift of 40 us/s is off by less than a microsecond.
    ///
    /// # Panics
    /// When the clock shows a time before 1970.
    #[must_use]
    pub fn variables(&self, faketime: &Faketime) -> Vec<(&'static str, String)> {
        let gained_s = self.drift * (now() - self.since).as_secs_f64();
        let shown = format!("{:+.9} x{:.9}", self.offset_s + gained_s, 1.0 + self.drift);
        let mut variables = faketime.variables().to_vec();
        variables.push(("FAKETIME", shown));
        variables
    }
}

fn now() -> Stamp<Host> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    Stamp::from_nanos(i64::try_from(now.as_nanos()).unwrap())
}
