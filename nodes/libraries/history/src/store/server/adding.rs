//! One attempt to add an entry, in one transaction.

use std::collections::BTreeMap;

use tokio_postgres::{Client, Error, Transaction};

use crate::entry::Entry;
use crate::store::{Added, KeptFigures, of_known};

/// Adds an entry unless it is there; `is_unknown` becomes true when the end of the transaction has no answer.
pub async fn add(
    client: &mut Client,
    entry: &Entry,
    is_unknown: &mut bool,
) -> Result<Added, Error> {
    let transaction = client.transaction().await?;
    // Waits for another writer of the same entry, and then finds its row.
    let Some(id) = insert_entry(&transaction, entry).await? else {
        let added = known(&transaction, entry).await?;
        transaction.rollback().await?;
        // What an attempt without an answer kept is new.
        let is_ours = *is_unknown && added == Added::Known;
        return Ok(if is_ours { Added::New } else { added });
    };
    insert_figures(&transaction, entry, id).await?;
    *is_unknown = true;
    transaction.commit().await?;
    *is_unknown = false;
    Ok(Added::New)
}

/// The row of a new entry; `None` where there is one of its kind and hash.
async fn insert_entry(transaction: &Transaction<'_>, entry: &Entry) -> Result<Option<i64>, Error> {
    let sql = "INSERT INTO entry (machine, at_s, kind, sha256, machine_sha256, source, instruments, operator, software)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)
         ON CONFLICT (kind, sha256) DO NOTHING RETURNING id";
    let kind = entry.kind.name();
    let row = transaction
        .query_opt(
            sql,
            &[
                &entry.machine,
                &entry.at_s,
                &kind,
                &entry.sha256,
                &entry.machine_sha256,
                &entry.source,
                &entry.instruments,
                &entry.operator,
                &entry.software,
            ],
        )
        .await?;
    row.map(|row| row.try_get(0)).transpose()
}

/// Series in the order of their keys, so that two writers meet in one order; then all figures at once.
async fn insert_figures(
    transaction: &Transaction<'_>,
    entry: &Entry,
    id: i64,
) -> Result<(), Error> {
    let all = &entry.figures;
    let tests: Vec<&str> = all.iter().map(|it| it.test.as_str()).collect();
    let names: Vec<&str> = all.iter().map(|it| it.name.as_str()).collect();
    let axes: Vec<&str> = all.iter().map(|it| it.axis.as_str()).collect();
    let units: Vec<&str> = all.iter().map(|it| it.unit.as_str()).collect();
    let statuses: Vec<&str> = all.iter().map(|it| it.status.as_str()).collect();
    let values: Vec<f64> = all.iter().map(|it| it.value).collect();
    let uncertainties: Vec<Option<f64>> = all.iter().map(|it| it.standard_uncertainty).collect();
    let end = |which: usize| -> Vec<Option<f64>> {
        let ends = all.iter().map(|it| it.interval);
        ends.map(|ends| ends.map(|ends| ends[which])).collect()
    };
    let (low, high) = (end(0), end(1));
    let series = "INSERT INTO series (machine, test, name, axis, unit)
         SELECT DISTINCT $1::text, k.test, k.name, k.axis, k.unit
         FROM unnest($2::text[], $3::text[], $4::text[], $5::text[]) AS k (test, name, axis, unit)
         ORDER BY k.name, k.axis, k.test, k.unit
         ON CONFLICT (machine, name, axis, test, unit) DO NOTHING";
    transaction
        .execute(series, &[&entry.machine, &tests, &names, &axes, &units])
        .await?;
    let figures = "INSERT INTO figure (series, at_s, entry, value, standard_uncertainty, low, high, status)
         SELECT s.id, $6::int8, $7::int8, k.value, k.u, k.low, k.high, k.status
         FROM unnest($2::text[], $3::text[], $4::text[], $5::text[], $8::float8[], $9::float8[], $10::float8[], $11::float8[], $12::text[])
              AS k (test, name, axis, unit, value, u, low, high, status)
         JOIN series s ON s.machine = $1::text AND s.name = k.name AND s.axis = k.axis AND s.test = k.test AND s.unit = k.unit";
    transaction
        .execute(
            figures,
            &[
                &entry.machine,
                &tests,
                &names,
                &axes,
                &units,
                &entry.at_s,
                &id,
                &values,
                &uncertainties,
                &low,
                &high,
                &statuses,
            ],
        )
        .await?;
    Ok(())
}

/// What an entry that is there says of the one to add.
async fn known(transaction: &Transaction<'_>, entry: &Entry) -> Result<Added, Error> {
    let sql = "SELECT id, machine, at_s FROM entry WHERE kind = $1 AND sha256 = $2";
    let kind = entry.kind.name();
    let row = transaction.query_one(sql, &[&kind, &entry.sha256]).await?;
    let (id, machine, at_s): (i64, String, i64) =
        (row.try_get(0)?, row.try_get(1)?, row.try_get(2)?);
    let sql = "SELECT s.test, s.name, s.axis, f.value FROM figure f JOIN series s ON s.id = f.series WHERE f.entry = $1";
    let mut kept: KeptFigures = BTreeMap::new();
    for row in transaction.query(sql, &[&id]).await? {
        let key = (row.try_get(0)?, row.try_get(1)?, row.try_get(2)?);
        kept.insert(key, row.try_get(3)?);
    }
    Ok(of_known(entry, (machine, at_s), &kept))
}
