//! Which measurement the owner of a laser's file names.

use anyhow::{Result, bail};

/// Words for the owner of a file that is of another measurement.
const OTHER_TESTS: [&str; 9] = [
    "straight",
    "velocity",
    "squareness",
    "pitch",
    "yaw",
    "roll",
    "flatness",
    "parallel",
    "dynamic",
];
/// Words for the owner of a file of angles.
const OF_ANGLES: [&str; 2] = ["angular", "rotary"];

/// Refuses a file of another measurement, and one of lengths whose owner measured angles; `owner` is in small letters.
///
/// # Errors
/// With the owner.
pub fn check(owner: &str, is_of_lengths: bool) -> Result<()> {
    let mut words = owner.split(|letter: char| !letter.is_alphabetic());
    let is_named = |other: &&&str| words.clone().any(|word| word.starts_with(**other));
    if let Some(other) = OTHER_TESTS.iter().find(is_named) {
        bail!("Owner is {owner:?}: {other} is no positioning test, and is not read");
    }
    if is_of_lengths && words.any(|word| OF_ANGLES.contains(&word)) {
        bail!(
            "a file of lengths (rtl), and its Owner is {owner:?}, which measures angles: correct \"Owner\" or \"File type\" under HEADER::"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_lengths_by_an_owner_of_angles_is_refused() {
        for owner in ["angular", "rotary", "my angular run"] {
            let said = check(owner, true).expect_err(owner).to_string();
            assert!(said.contains("which measures angles"), "{said}");
            check(owner, false).expect(owner);
        }
        for owner in ["linear", "", "other linear"] {
            check(owner, true).expect(owner);
        }
        assert!(check("pitch", false).is_err());
    }
}
