//! Which numbers a field may have.

/// What a number may be.
#[derive(Clone, Copy)]
pub(crate) enum Allowed {
    /// NaN and the infinities are refused.
    Finite,
    /// NaN has a meaning.
    OrNan,
    /// Plus infinity has a meaning.
    OrInfinite,
    /// Nobody may use the number.
    Anything,
}

impl Allowed {
    pub(super) fn takes(self, value: f64) -> bool {
        match self {
            Self::Finite => value.is_finite(),
            Self::OrNan => !value.is_infinite(),
            Self::OrInfinite => value.is_finite() || value == f64::INFINITY,
            Self::Anything => true,
        }
    }

    pub(super) const fn is_unused(self) -> bool {
        matches!(self, Self::Anything)
    }

    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Finite => "a finite number",
            Self::OrNan => "a finite number or NaN",
            Self::OrInfinite => "a finite number or +inf",
            Self::Anything => "anything",
        }
    }
}
