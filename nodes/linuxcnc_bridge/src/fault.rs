//! What an error message of LinuxCNC means for the program that was running.
//!
//! LinuxCNC reports faults as text only. The phrases are those of LinuxCNC 2.9 in English; a text
//! that is not known stays a fault of its own kind and is passed on word for word.

/// Meaning of an error message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// A probing move ended without contact.
    ProbeMissed,
    /// The probe was closed when it should have been open.
    ProbeStuck,
    /// A motion would leave, or has left, the travel.
    Limit,
    /// A drive lags too far behind its command.
    FollowingError,
    /// The machine does not know where it is.
    NotHomed,
    /// The servo thread ran late for the first time since LinuxCNC was started. It says so once and goes on: no program ends
    /// of it.
    RealtimeDelay,
    /// The probe was touched while no touch was under way.
    ProbeTripped,
    /// An axis does not go where a program of machine coordinates sends it.
    Astray,
    /// The program's text is wrong, or anything else.
    Other,
}

/// What LinuxCNC says where it gives up a program over its own queue, on a busy computer; it may be run again.
pub const QUEUE_FAULT: &str = "Queue is not empty after probing";

/// Classifies one message.
#[must_use]
pub fn classify(message: &str) -> FaultKind {
    let text = message.to_ascii_lowercase();
    let has = |phrase: &str| text.contains(phrase);
    if has("without making contact") || has("without breaking contact") {
        FaultKind::ProbeMissed
    } else if has("probe tripped") {
        FaultKind::ProbeTripped
    } else if has("probe is already") {
        FaultKind::ProbeStuck
    } else if has("following error") {
        FaultKind::FollowingError
    } else if has("unexpected realtime delay") {
        FaultKind::RealtimeDelay
    } else if has("homed") || has("homing") {
        FaultKind::NotHomed
    } else if has("limit") {
        FaultKind::Limit
    } else {
        FaultKind::Other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recorded_messages_are_understood() {
        let cases = [
            (
                "G38.2 move finished without making contact.",
                FaultKind::ProbeMissed,
            ),
            (
                "Probe is already tripped when starting G38.2 or G38.3 move",
                FaultKind::ProbeStuck,
            ),
            (
                "Linear move on line 2 would exceed X's positive limit",
                FaultKind::Limit,
            ),
            (
                "Probe tripped during non-probe move.",
                FaultKind::ProbeTripped,
            ),
            ("joint 0 following error", FaultKind::FollowingError),
            (
                "Can't issue MDI command when not homed",
                FaultKind::NotHomed,
            ),
            (
                "Unexpected realtime delay on task 0 with period 1000000",
                FaultKind::RealtimeDelay,
            ),
            ("Bad character 'o' used", FaultKind::Other),
        ];
        for (message, kind) in cases {
            assert_eq!(classify(message), kind, "{message}");
        }
    }
}
