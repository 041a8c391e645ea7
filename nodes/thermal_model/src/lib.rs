//! Models thermal drift from reference blocks on the table.
