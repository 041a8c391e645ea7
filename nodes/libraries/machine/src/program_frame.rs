//! The frame in which a program's coordinates are: the machine's own, or whatever is set at the control.
//!
//! A program of the machine's frame says so by the comment `(frame: machine)` on its first line, before any
//! word. It obliges the controller to assert before the first motion what [`HEAD`] names and a work system
//! without offset and rotation, to verify it, and to leave its modal state as it was found. A program without
//! the comment is its author's own and runs in the state that is there, as on any control.
//!
//! [`HEAD`] names the words once more, so that a control that knows no such comment does the same as far as
//! words go. It cannot name a work system, for which one is without offset is known to the control alone.

/// What every generated program begins with: machine frame; mm, absolute, plane XY, no cutter compensation, no
/// tool length, no canned cycle, feed per minute, centres of arcs relative, exact path.
pub const HEAD: &str = "(frame: machine)\nG21 G90 G17 G40 G49 G80 G94 G91.1 G61\n";

/// Whether the coordinates of a program are those of the machine.
#[must_use]
pub fn is_machine_frame(program: &str) -> bool {
    let line = program.lines().next().unwrap_or("");
    comments(line).any(|comment| comment.counts() && is_frame_comment(comment.text))
}

/// The remedy for a comment of the frame that does not count.
pub const FRAME_RULE: &str = "once, in parentheses, on line 1, before any word";

/// Line of the first comment that names a frame and does not count: behind a word or a semicolon, below line 1, a
/// second one, or of another frame than the machine's. The program would run in the work system in use without a word.
#[must_use]
pub fn misplaced_frame(program: &str) -> Option<u32> {
    let mut is_known = false;
    for (number, line) in (1..).zip(program.lines()) {
        for comment in comments(line) {
            // Below line 1, what is behind a semicolon is the author's own text.
            let is_own = number > 1 && comment.place == Place::Tail;
            let is_named = match comment.place {
                Place::Tail => names_frame(comment.text),
                Place::First | Place::BehindWord => has_frame_key(comment.text),
            };
            if is_own || !is_named {
                continue;
            }
            let is_right = number == 1 && comment.counts() && is_frame_comment(comment.text);
            if !is_right || is_known {
                return Some(number);
            }
            is_known = true;
        }
    }
    None
}

/// Where a comment stands in its line.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    /// In parentheses, before any word.
    First,
    /// In parentheses, behind a word.
    BehindWord,
    /// Behind a semicolon, up to the end.
    Tail,
}

struct Comment<'a> {
    text: &'a str,
    place: Place,
}

impl Comment<'_> {
    fn counts(&self) -> bool {
        self.place == Place::First
    }
}

/// The comments of a line, in their order; one without its closing parenthesis does not count.
fn comments(line: &str) -> impl Iterator<Item = Comment<'_>> {
    let (mut rest, mut place) = (line, Place::First);
    std::iter::from_fn(move || {
        let begin = rest.find(['(', ';'])?;
        if !rest[..begin].trim().is_empty() {
            place = Place::BehindWord;
        }
        let behind = &rest[begin + 1..];
        if rest[begin..].starts_with(';') {
            rest = "";
            let place = Place::Tail;
            return Some(Comment {
                text: behind,
                place,
            });
        }
        let (text, behind) = behind.split_once(')')?;
        rest = behind;
        Some(Comment { text, place })
    })
}

/// Whether the text behind a semicolon names a frame, with or without parentheses around it.
#[must_use]
pub fn names_frame(tail: &str) -> bool {
    tail.split([';', '(', ')']).any(has_frame_key)
}

fn has_frame_key(comment: &str) -> bool {
    let key = comment.split_once(':').map(|(key, _)| key.trim());
    key.is_some_and(|key| key.eq_ignore_ascii_case("frame"))
}

fn is_frame_comment(comment: &str) -> bool {
    comment.split_once(':').is_some_and(|(key, frame)| {
        key.trim().eq_ignore_ascii_case("frame") && frame.trim().eq_ignore_ascii_case("machine")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_comment_counts_on_the_first_line_before_any_word() {
        for machine in [
            HEAD,
            "(frame: machine)",
            " ( Frame : MACHINE ) G21\nM2\n",
            "(a part) (frame: machine)\r\nG0 X1\r\nM2",
        ] {
            assert!(is_machine_frame(machine), "{machine:?}");
        }
        for other in [
            "",
            "G21\n(frame: machine)\nM2\n",
            "G21 (frame: machine)\nM2\n",
            "(a part)\n(frame: machine)\n",
            "(frame: work)\n",
            "(frame machine)\n",
            "(frame: machine\nG21\n",
            ";(frame: machine)\n",
            "frame: machine\n",
        ] {
            assert!(!is_machine_frame(other), "{other:?}");
        }
    }

    #[test]
    fn a_frame_comment_that_does_not_count_is_found_with_its_line() {
        for (program, line) in [
            (";(frame: machine)\nM2\n", 1),
            ("; frame: machine", 1),
            (";FRAME : machine\nM2", 1),
            (" ; ( Frame : machin ) G21", 1),
            ("G21 ;; (frame: machine)\r\nM2", 1),
            ("(a part; of it) ; a part (frame: machine)", 1),
            ("(frame: machin)\nM2", 1),
            ("(frame: work)", 1),
            ("( FRAME : )\nM2", 1),
            ("G21 (frame: machine)\nM2", 1),
            ("(frame: machine) (frame: machine)", 1),
            ("(a part)\n(frame: machine)\nM2", 2),
            ("(frame: machine)\nG21\n(Frame: machine)", 3),
            ("(frame: machine)\nG0 X1 (frame: work)", 2),
        ] {
            assert_eq!(misplaced_frame(program), Some(line), "{program:?}");
        }
        for other in [
            "",
            HEAD,
            "(frame: machine) ; of a part",
            "(a part) (frame: machine) G21\nM2",
            "(a ; frame: machine)\nM2",
            "; a frame of wood: oak",
            "; part\n;(frame: machine)\n",
            "G21 ; the frame (steel)",
            "(a frame of wood: oak)\nM2",
            "(frame: machine",
        ] {
            assert_eq!(misplaced_frame(other), None, "{other:?}");
        }
    }
}
