//! What a LinuxCNC leaves behind that was killed, not ended.
//!
//! HAL's sampler and streamer keep their queues in shared memory of the system, whose last user removes it.
//! Where all were killed it stays until the computer is switched off, and a later configuration that records
//! more pins cannot be started: the memory is there, and too small. LinuxCNC's start script clears what it
//! knows of, not these.

use std::process::Command;

use procfs::{Current, SharedMemorySegments, Shm};

use crate::error::BridgeError;

/// First keys of the components' queues, one key for each of [`QUEUES`] (LinuxCNC, `streamer.h`).
const FIRST_KEYS: [i32; 2] = [0x4853_4130, 0x4853_5430];
/// Queues that a component can have.
const QUEUES: i32 = 8;

fn is_abandoned_queue(segment: &Shm) -> bool {
    segment.nattch == 0
        && FIRST_KEYS
            .iter()
            .any(|first| (*first..first + QUEUES).contains(&segment.key))
}

/// Removes queues that nobody is attached to; only for a time when no LinuxCNC runs.
///
/// # Errors
/// Names the memory that could not be removed, and its owner.
pub fn clear() -> Result<(), BridgeError> {
    let segments = match SharedMemorySegments::current() {
        Ok(segments) => segments.0,
        Err(error) => {
            tracing::info!("what a killed LinuxCNC left is not looked for: {error}");
            return Ok(());
        }
    };
    for segment in segments
        .iter()
        .filter(|segment| is_abandoned_queue(segment))
    {
        let refused = |reason: String| BridgeError::QueueLeftBehind {
            id: segment.shmid,
            owner: segment.uid,
            reason,
        };
        let outcome = Command::new("ipcrm")
            .args(["-m", &segment.shmid.to_string()])
            .output()
            .map_err(|error| refused(error.to_string()))?;
        if !outcome.status.success() {
            let reason = String::from_utf8_lossy(&outcome.stderr).trim().to_owned();
            return Err(refused(reason));
        }
        tracing::info!(
            "removed shared memory {} of a LinuxCNC that was killed ({} bytes)",
            segment.shmid,
            segment.size
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use procfs::FromRead;

    use super::*;

    #[test]
    fn only_queues_that_nobody_is_attached_to_are_taken_for_abandoned() {
        let head =
            "key shmid perms size cpid lpid nattch uid gid cuid cgid atime dtime ctime rss swap";
        let row = |key: i32, nattch: u32| {
            format!("{key} {nattch} 666 352128 7 7 {nattch} 65534 65534 65534 65534 1 1 1 0 0")
        };
        let rows = [
            head.to_owned(),
            row(0x4853_4130, 0),
            row(0x4853_4137, 0),
            row(0x4853_5430, 0),
            row(0x4853_4130, 2),
            row(0x4853_4138, 0),
            row(0x4853_412f, 0),
            // HAL itself, which LinuxCNC clears.
            row(0x4841_4c32, 0),
        ];
        let read = SharedMemorySegments::from_read(rows.join("\n").as_bytes()).unwrap();
        let found: Vec<bool> = read.0.iter().map(is_abandoned_queue).collect();
        assert_eq!(found, [true, true, true, false, false, false, false]);
    }
}
