//! The search: signatures of effects, sets of them that explain the residual, and what the recording resolves.

pub(crate) mod challenge;
pub(crate) mod families;
pub(crate) mod field;
pub(crate) mod isolability;
pub(crate) mod lines;
pub(crate) mod nuisance;
pub(crate) mod periods;
pub mod problem;
pub(crate) mod refit;
pub mod regression;
pub(crate) mod resolved;
pub(crate) mod rows;
pub(crate) mod searched;
pub(crate) mod selection;
pub(crate) mod signature;
pub(crate) mod widening;
