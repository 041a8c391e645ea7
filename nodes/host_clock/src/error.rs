//! Parameters that cannot work and inputs that break the stage's contract.

use metrology::bound::{BoundError, NAME_BYTES};
use metrology::number::number;

/// Why a stage is not built, or an event not taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HostClockError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// A host without a name.
    #[error("{name} is empty: must be the name of a host")]
    Nameless {
        /// Parameter.
        name: &'static str,
    },
    /// The name of a host that no message carries.
    #[error("{name}: {bytes} bytes of text: at most {NAME_BYTES}")]
    NameTooLong {
        /// Parameter.
        name: &'static str,
        /// Its length.
        bytes: usize,
    },
    /// The window cannot hold as many exchanges as an estimate needs.
    #[error(
        "window_s = {window_s}: holds {holds} exchanges at period_ms = {period_ms}, least_exchanges = {least_exchanges} are needed", window_s = number(*window_s), period_ms = number(*period_ms))]
    WindowTooShort {
        /// Time that is looked back, s.
        window_s: f64,
        /// Between questions, ms.
        period_ms: f64,
        /// Exchanges that fit.
        holds: usize,
        /// Exchanges that are needed.
        least_exchanges: usize,
    },
}
