//! Rows and parameters of a server, in the forms of those of a file.

use rusqlite::types::ValueRef;
use tokio_postgres::Row;
use tokio_postgres::types::{FromSql, ToSql, Type};

use crate::store::cells::Fault;
use crate::store::row::{Key, TableRow};

impl TableRow for Row {
    fn cell(&self, place: usize) -> Result<ValueRef<'_>, Fault> {
        let column = self.columns().get(place).map(tokio_postgres::Column::type_);
        Ok(match column {
            Some(&Type::INT8) => value(self, place)?.map_or(ValueRef::Null, ValueRef::Integer),
            Some(&Type::FLOAT8) => value(self, place)?.map_or(ValueRef::Null, ValueRef::Real),
            Some(&Type::TEXT) => value(self, place)?
                .map_or(ValueRef::Null, |text: &str| ValueRef::Text(text.as_bytes())),
            _ => ValueRef::Blob(&[]),
        })
    }
}

fn value<'r, T: FromSql<'r>>(row: &'r Row, place: usize) -> Result<Option<T>, Fault> {
    row.try_get(place)
        .map_err(|error| Fault::Cell(error.to_string()))
}

/// The type of a parameter.
pub const fn type_of(key: &Key<'_>) -> Type {
    match key {
        Key::Text(_) => Type::TEXT,
        Key::Whole(_) => Type::INT8,
    }
}

/// A parameter as the server takes it.
pub const fn parameter<'k>(key: &'k Key<'k>) -> &'k (dyn ToSql + Sync) {
    match key {
        Key::Text(text) => text,
        Key::Whole(number) => number,
    }
}
