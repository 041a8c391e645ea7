//! What the map of an imported table states of the measurement, as `params/import.yaml` of its bag carries it.
//!
//! The motion in such a bag is made up: its times, its rests and, where the map was proposed, its feed are nobody's statement.

use chrono::DateTime;
use metrology::text::{self, Comments};
use metrology::yaml;
use recorder::Bag;
use serde::Deserialize;

/// Name in the bag.
const FILE: &str = "params/import.yaml";

/// A value of a map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OfMap {
    /// A person stated it, in words.
    Stated(String),
    /// The program assumed it, in words.
    Assumed(String),
    /// The map has no such value.
    Absent,
}

/// The measurement behind a table.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Imported {
    start_s: Option<i64>,
    feed_mm_min: Option<f64>,
    feed_deg_min: Option<f64>,
    dwell_s: Option<f64>,
    /// Stands where a list of touches has no times.
    touch_times: Option<String>,
    /// Keys whose value the program assumed.
    assumed: Vec<String>,
}

impl Imported {
    /// Of a bag; `None` where it is of no table, or of a version that stated no begin.
    #[must_use]
    pub fn of(bag: &Bag) -> Option<Self> {
        let attached = bag.attachment(FILE).ok()??;
        let text = text::decode(&attached.data, Comments::Yaml).ok()?;
        let read: Self = yaml::read(&text).ok()?;
        read.start_s.is_some().then_some(read)
    }

    /// Whether the times in the bag are those of a motion that nobody recorded.
    #[must_use]
    pub const fn is_motion_made_up(&self) -> bool {
        self.feed_mm_min.is_some() || self.feed_deg_min.is_some() || self.touch_times.is_some()
    }

    /// When the measurement began, ns since 1970.
    #[must_use]
    pub fn begin_nanos(&self) -> Option<i64> {
        let stated = self.start_s.filter(|_| !self.is_assumed("start_s"));
        stated?.checked_mul(1_000_000_000)
    }

    /// When the measurement began.
    #[must_use]
    pub fn begin(&self) -> OfMap {
        let date = |nanos| DateTime::from_timestamp_nanos(nanos).format("%Y-%m-%d %H:%M:%S UTC");
        let begin = self.begin_nanos();
        begin.map_or(OfMap::Absent, |nanos| {
            OfMap::Stated(date(nanos).to_string())
        })
    }

    /// Feed between stops, or along circles, in words.
    #[must_use]
    pub fn feed(&self) -> OfMap {
        let linear = self.value("feed_mm_min", self.feed_mm_min, |feed| {
            format!("{feed:.0} mm/min")
        });
        match linear {
            OfMap::Absent => self.value("feed_deg_min", self.feed_deg_min, |feed| {
                format!("{feed:.0} deg/min")
            }),
            known => known,
        }
    }

    /// The feed that a person stated, mm/min.
    #[must_use]
    pub fn stated_feed_mm_min(&self) -> Option<f64> {
        self.feed_mm_min.filter(|_| !self.is_assumed("feed_mm_min"))
    }

    /// Rest at each stop, in words.
    #[must_use]
    pub fn dwell(&self) -> OfMap {
        self.value("dwell_s", self.dwell_s, |dwell| format!("{dwell:.1} s"))
    }

    fn is_assumed(&self, key: &str) -> bool {
        self.assumed.iter().any(|assumed| assumed == key)
    }

    fn value(&self, key: &str, value: Option<f64>, in_words: fn(f64) -> String) -> OfMap {
        match value.map(in_words) {
            None => OfMap::Absent,
            Some(words) if self.is_assumed(key) => OfMap::Assumed(words),
            Some(words) => OfMap::Stated(words),
        }
    }
}
