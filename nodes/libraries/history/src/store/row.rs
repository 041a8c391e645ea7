//! Rows and parameters that every kind of store has.

use rusqlite::types::{ToSql, ToSqlOutput, Value, ValueRef};

use super::cells::Fault;

/// A row of an answer.
pub trait TableRow {
    /// The value of a column.
    fn cell(&self, place: usize) -> Result<ValueRef<'_>, Fault>;
}

impl TableRow for rusqlite::Row<'_> {
    fn cell(&self, place: usize) -> Result<ValueRef<'_>, Fault> {
        Ok(self.get_ref(place)?)
    }
}

/// A parameter of a question.
#[derive(Clone, Copy, Debug)]
pub enum Key<'k> {
    /// A text, or none.
    Text(Option<&'k str>),
    /// A whole number.
    Whole(i64),
}

impl ToSql for Key<'_> {
    fn to_sql(&self) -> rusqlite::Result<ToSqlOutput<'_>> {
        Ok(match self {
            Key::Text(Some(text)) => ToSqlOutput::Borrowed(ValueRef::Text(text.as_bytes())),
            Key::Text(None) => ToSqlOutput::Owned(Value::Null),
            Key::Whole(number) => ToSqlOutput::Owned(Value::Integer(*number)),
        })
    }
}
