//! Why a history cannot be kept or read.

use std::path::PathBuf;

use metrology::number::number;

/// Errors of entries and stores.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The file cannot be opened or made.
    #[error("history {path}: cannot be opened: {reason}: check folder and rights, or name another file with --store", path = path.display())]
    Unopened {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// There is no such file to read.
    #[error("history {path}: is not there: `abbe history add` or --keep makes it, or name another file with --store", path = path.display())]
    Absent {
        /// The file.
        path: PathBuf,
    },
    /// It is a device, a pipe or a socket.
    #[error("history {path}: is no regular file: name another file with --store", path = path.display())]
    NotRegular {
        /// What was named.
        path: PathBuf,
    },
    /// The file is no SQLite database, or a damaged one.
    #[error("history {path}: is no database, or a damaged one ({reason}): restore a copy, or name another file with --store", path = path.display())]
    NoDatabase {
        /// The file.
        path: PathBuf,
        /// What SQLite says.
        reason: String,
    },
    /// The file is a database of another program.
    #[error("history {path}: is a database of another program (application_id {found}, must be {wanted}): name another file with --store", path = path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Its application id.
        found: i64,
        /// Ours.
        wanted: i64,
    },
    /// A newer version wrote the file.
    #[error("history {path}: has schema version {found}, this version of abbe reads up to {known}: install the newer abbe", path = path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: i64,
        /// The newest known.
        known: i64,
    },
    /// An older version wrote the file, which is opened for reading alone.
    #[error("history {path}: has schema version {found}, must be {known}: any `abbe history add` brings it up to date", path = path.display())]
    Older {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: i64,
        /// The one that is read.
        known: i64,
    },
    /// Another program holds the file.
    #[error("history {path}: is locked by another program for more than {waited_ms} ms: end that program, or try again", path = path.display())]
    Locked {
        /// The file.
        path: PathBuf,
        /// How long it was waited for.
        waited_ms: u32,
    },
    /// The file cannot be written.
    #[error("history {path}: is read-only: allow writing to the file and its folder, or name another file with --store", path = path.display())]
    ReadOnly {
        /// The file.
        path: PathBuf,
    },
    /// There is no space left.
    #[error("history {path}: the disk or the file is full, nothing was added: make space, or name a file on another disk with --store", path = path.display())]
    Full {
        /// The file.
        path: PathBuf,
    },
    /// A server is away, or does not answer in time.
    #[error("history {path}: no answer within {waited_ms} ms ({reason}): start the server, check host, port and network, or name a file with --store; nothing was kept", path = path.display())]
    Unreachable {
        /// Its URL without the password.
        path: PathBuf,
        /// How long it was waited for.
        waited_ms: u32,
        /// What was seen last.
        reason: String,
    },
    /// A parameter of a URL.
    #[error("history {path}: {key} = {value}: must be {must}", path = path.display())]
    BadParameter {
        /// Its URL without the password.
        path: PathBuf,
        /// Which.
        key: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        must: &'static str,
    },
    /// A certificate, a key or a list of revoked certificates.
    #[error("history {path}: {key} {file}: {reason}: name another PEM file in the URL", path = path.display(), file = file.display())]
    BadTlsFile {
        /// Its URL without the password.
        path: PathBuf,
        /// Which parameter of the URL names it.
        key: &'static str,
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A server without TLS, where there must be TLS.
    #[error("history {path}: the server offers no TLS: set `ssl = on` at the server, check that nobody stands between, or state sslmode=disable on a network that you trust; no password was sent", path = path.display())]
    NoTls {
        /// Its URL without the password.
        path: PathBuf,
    },
    /// A server that is not who it must be, or does not accept the client's certificate.
    #[error("history {path}: no TLS with this server ({reason}): check the host in the URL, sslrootcert, sslcert, and the dates of the certificates (docs/history.md); nothing was kept", path = path.display())]
    Untrusted {
        /// Its URL without the password.
        path: PathBuf,
        /// OpenSSL's words.
        reason: String,
    },
    /// The user of a server may not read or write.
    #[error("history {path}: the user may not do this: {reason}: grant it to the user (docs/history.md), or name another one in --store", path = path.display())]
    Refused {
        /// Its URL without the password.
        path: PathBuf,
        /// The server's words.
        reason: String,
    },
    /// Anything else that a server reports.
    #[error("history {path}: {reason}: nothing was kept", path = path.display())]
    Server {
        /// Its URL without the password.
        path: PathBuf,
        /// The server's words.
        reason: String,
    },
    /// The program has no stores on servers.
    #[error("history {path}: this program was built without the feature `postgres`: build it with `cargo build --release --features postgres`, or name a file with --store", path = path.display())]
    NoFeature {
        /// The URL without the password.
        path: PathBuf,
    },
    /// Anything else that SQLite reports.
    #[error("history {path}: {source}", path = path.display())]
    Database {
        /// The file.
        path: PathBuf,
        /// The report.
        source: rusqlite::Error,
    },
    /// A row holds what this program never writes.
    #[error("history {path}: table {table}, {row}: {column} = {found}: must be {must}: another program changed it; restore a copy, or mend or delete this row with sqlite3", path = path.display())]
    BadRow {
        /// The file.
        path: PathBuf,
        /// The table.
        table: &'static str,
        /// Which row.
        row: String,
        /// The column.
        column: &'static str,
        /// Its value, or the begin of it.
        found: String,
        /// The bound.
        must: String,
    },
    /// More rows match than are read.
    #[error("history {path}: more than {most} {rows}: choose less with --since, --test or --figure", path = path.display())]
    TooMany {
        /// The file.
        path: PathBuf,
        /// Kind of rows.
        rows: &'static str,
        /// The limit.
        most: usize,
    },
    /// A text of an entry is empty or too long, or has a control character.
    #[error("{key} = {text:?}: must have 1 to {most_bytes} bytes and no control character")]
    BadText {
        /// Which.
        key: &'static str,
        /// Its begin.
        text: String,
        /// The limit.
        most_bytes: usize,
    },
    /// A hash is not one.
    #[error("{key} = {text:?}: must be a SHA-256 as 64 hexadecimal digits")]
    BadHash {
        /// Which.
        key: &'static str,
        /// Its begin.
        text: String,
    },
    /// The time of an entry is out of range.
    #[error("time = {at_s} s since 1970: must be from {least} to {greatest} (1970 to 2106)")]
    BadTime {
        /// The time.
        at_s: i64,
        /// Least.
        least: i64,
        /// Greatest.
        greatest: i64,
    },
    /// A figure is not finite or out of range.
    #[error(
        "{figure}: {key} = {value}: must be finite and at most {greatest} in magnitude",
        value = number(*value),
        greatest = number(*greatest)
    )]
    BadNumber {
        /// Name of the figure.
        figure: String,
        /// Which of its numbers.
        key: &'static str,
        /// The number.
        value: f64,
        /// The limit.
        greatest: f64,
    },
    /// A figure below zero that is never below it, or larger than any of a machine.
    #[error(
        "{test}: {figure} = {value} {unit}: must be from {least} to {greatest} {unit}: measure again, or correct the report",
        value = number(*value),
        least = number(*least),
        greatest = number(*greatest)
    )]
    NoFigure {
        /// Title of its test.
        test: String,
        /// Name of the figure.
        figure: String,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: String,
        /// Least value.
        least: f64,
        /// Greatest value.
        greatest: f64,
    },
    /// An uncertainty below zero.
    #[error("{figure}: standard_uncertainty = {value}: must not be below 0", value = number(*value))]
    BadUncertainty {
        /// Name of the figure.
        figure: String,
        /// The uncertainty.
        value: f64,
    },
    /// An entry has no figure, or too many.
    #[error("{source_name}: {n} figures: must be from 1 to {most}{remedy}", remedy = remedy_of_count(*n))]
    BadCount {
        /// Where the entry is from.
        source_name: String,
        /// How many.
        n: usize,
        /// The limit.
        most: usize,
    },
    /// A report is none of a known form.
    #[error(
        "is no report: must have the key `tests` of `abbe report --json` or of a run, or `schema: abbe.gap/1`"
    )]
    NoReport,
}

/// What to do about a number of figures that is not kept.
const fn remedy_of_count(n: usize) -> &'static str {
    if n == 0 {
        "; a history keeps figures of evaluated tests and causes of diagnoses, and nothing here has one: keep a bag of which `abbe report` shows figures"
    } else {
        "; keep the tests in several reports"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_without_a_figure_is_refused_with_the_remedy() {
        let of = |n| HistoryError::BadCount {
            source_name: "a_bag".to_owned(),
            n,
            most: 10_000,
        };
        let none = of(0).to_string();
        assert!(
            none.starts_with("a_bag: 0 figures: must be from 1 to 10000; "),
            "{none}"
        );
        assert!(none.contains("abbe report"), "{none}");
        assert!(of(10_001).to_string().contains("several reports"));
    }
}
