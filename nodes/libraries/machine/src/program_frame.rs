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
    let mut rest = program.lines().next().unwrap_or("").trim_start();
    while let Some((comment, behind)) = rest.strip_prefix('(').and_then(|open| open.split_once(')'))
    {
        if is_frame_comment(comment) {
            return true;
        }
        rest = behind.trim_start();
    }
    false
}

/// The remedy for a comment of the frame behind a semicolon.
pub const FRAME_RULE: &str = "once, in parentheses, on line 1, before any word";

/// Whether a comment behind a semicolon on the first line names a frame, which counts in parentheses alone:
/// `;(frame: machine)` would run in the work system in use without a word.
#[must_use]
pub fn has_frame_behind_semicolon(program: &str) -> bool {
    let line = program.lines().next().unwrap_or("");
    let mut is_open = false;
    let begin = line.char_indices().find(|(_, character)| {
        is_open = (is_open || *character == '(') && *character != ')';
        *character == ';' && !is_open
    });
    begin.is_some_and(|(at, _)| names_frame(&line[at..]))
}

/// Whether the text behind a semicolon names a frame, with or without parentheses around it.
#[must_use]
pub fn names_frame(tail: &str) -> bool {
    tail.split([';', '(', ')']).any(|part| {
        let key = part.split_once(':').map(|(key, _)| key.trim());
        key.is_some_and(|key| key.eq_ignore_ascii_case("frame"))
    })
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
    fn a_frame_behind_a_semicolon_on_the_first_line_is_found() {
        for behind in [
            ";(frame: machine)\nM2\n",
            "; frame: machine",
            ";FRAME : machine\nM2",
            " ; ( Frame : machin ) G21",
            "G21 ;; (frame: machine)\r\nM2",
            "(a part; of it) ; a part (frame: machine)",
        ] {
            assert!(has_frame_behind_semicolon(behind), "{behind:?}");
        }
        for other in [
            "",
            HEAD,
            "(frame: machine) ; of a part",
            "(a ; frame: machine)\nM2",
            "; a frame of wood: oak",
            "; part\n;(frame: machine)\n",
            "G21 ; the frame (steel)",
        ] {
            assert!(!has_frame_behind_semicolon(other), "{other:?}");
        }
    }
}
