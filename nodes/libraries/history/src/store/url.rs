//! URLs of servers: which stores are on one, and how they are shown without their password.

use std::path::{Path, PathBuf};

/// Begins of a URL of a server.
const BEGINS: [&str; 2] = ["postgres://", "postgresql://"];

/// The URL, where a store is on a server.
pub fn of(path: &Path) -> Option<&str> {
    let text = path.to_str()?;
    BEGINS
        .iter()
        .any(|begin| text.starts_with(begin))
        .then_some(text)
}

/// Whether a store is on a server and in no file.
#[must_use]
pub fn is_server(path: &Path) -> bool {
    of(path).is_some()
}

/// The path of a store for messages: a URL without its password and its parameters, which may have one too.
#[must_use]
pub fn shown(path: &Path) -> PathBuf {
    let Some(url) = of(path) else {
        return path.to_owned();
    };
    let (url, query) = url.split_once('?').unwrap_or((url, ""));
    let (scheme, rest) = url.split_once("://").unwrap_or(("", url));
    // A password with a bare `?` ends there: nothing tells it from a host and its port.
    if query.contains('@') {
        return PathBuf::from(format!("{scheme}://"));
    }
    let end = rest.rfind('@').unwrap_or(0);
    let (user, place) = rest.split_at(end);
    let (user, _) = user.split_once(':').unwrap_or((user, ""));
    PathBuf::from(format!("{scheme}://{user}{place}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_url_is_shown_without_password_and_parameters() {
        for (url, wanted) in [
            ("postgres://a:secret@h:5/d", "postgres://a@h:5/d"),
            ("postgres://a:se@cret@h/d", "postgres://a@h/d"),
            ("postgresql://h/d?password=secret", "postgresql://h/d"),
            ("postgres://a@h/d", "postgres://a@h/d"),
            ("postgres://a:sec?ret@h/d", "postgres://"),
            ("/var/history.sqlite", "/var/history.sqlite"),
        ] {
            assert_eq!(shown(Path::new(url)), Path::new(wanted));
            assert_eq!(is_server(Path::new(url)), url.starts_with("post"));
        }
    }
}
