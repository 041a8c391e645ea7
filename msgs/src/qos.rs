//! Quality of service, free of any transport's types.
//!
//! History is always "keep last": "keep all" is bounded by a limit that nobody sees (64 samples on
//! the reader of the transport in use), so the depth is always written down.

use std::fmt::Write;

/// Whether lost samples are sent again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reliability {
    /// They are.
    Reliable,
    /// They are not.
    BestEffort,
}

/// Whether late readers get what was sent before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// They do not.
    Volatile,
    /// They do, up to the depth ("latched").
    TransientLocal,
}

/// Quality of service of a topic; no deadline, no lifespan, automatic liveliness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Whether lost samples are sent again.
    pub reliability: Reliability,
    /// Whether late readers get what was sent before.
    pub durability: Durability,
    /// Samples kept on either side.
    pub depth: u32,
}

impl Qos {
    /// Events: none lost as long as fewer than 200 wait.
    pub const RELIABLE: Self = Self::reliable(200);
    /// Samples at 1 kHz: none lost over a stall of 20 s.
    pub const RELIABLE_DEEP: Self = Self::reliable(20_000);
    /// State that late readers need too.
    pub const LATCHED: Self = Self::latched(1);
    /// Samples of which a lost one does not matter.
    pub const SENSOR_DATA: Self = Self::best_effort(100);

    const fn reliable(depth: u32) -> Self {
        Self {
            reliability: Reliability::Reliable,
            durability: Durability::Volatile,
            depth,
        }
    }

    const fn latched(depth: u32) -> Self {
        Self {
            durability: Durability::TransientLocal,
            ..Self::reliable(depth)
        }
    }

    const fn best_effort(depth: u32) -> Self {
        Self {
            reliability: Reliability::BestEffort,
            ..Self::reliable(depth)
        }
    }

    /// The `offered_qos_profiles` text of rosbag2: a YAML list of this one profile.
    #[must_use]
    pub fn offered_qos_profiles(self) -> String {
        let reliability = match self.reliability {
            Reliability::Reliable => "reliable",
            Reliability::BestEffort => "best_effort",
        };
        let durability = match self.durability {
            Durability::Volatile => "volatile",
            Durability::TransientLocal => "transient_local",
        };
        let mut text = format!("- history: keep_last\n  depth: {}\n", self.depth);
        let mut put = |line: std::fmt::Arguments<'_>| {
            text.write_fmt(line)
                .expect("writing to a String cannot fail");
        };
        put(format_args!("  reliability: {reliability}\n"));
        put(format_args!("  durability: {durability}\n"));
        for (name, between) in [
            ("deadline", ""),
            ("lifespan", "  liveliness: automatic\n"),
            ("liveliness_lease_duration", ""),
        ] {
            // Infinite in ROS 2: the greatest i64 of nanoseconds.
            put(format_args!(
                "  {name}:\n    sec: 9223372036\n    nsec: 854775807\n{between}"
            ));
        }
        put(format_args!("  avoid_ros_namespace_conventions: false\n"));
        text
    }
}
