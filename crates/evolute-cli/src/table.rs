//! The table that `probe` writes: the rows that it read, and what their receivers get.

use evolute::geometry::Rgb;
use evolute::output::{Array, ArrayData, csv_field, csv_number, encode_npz};
use evolute::solve::ProbeLight;

use crate::failure::Failure;
use crate::points::{COLUMNS, Points};

/// Parts of the irradiance, in the order of their columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    pub direct: bool,
    pub specular: bool,
    pub indirect: bool,
    pub total: bool,
}

/// The name of a component, and where it is found.
type Part = (&'static str, fn(&ProbeLight) -> Rgb);

impl Asked {
    pub const ALL: Self = Self { direct: true, specular: true, indirect: true, total: true };
    pub const NONE: Self = Self { direct: false, specular: false, indirect: false, total: false };

    /// What the list of the command line asks for; all if it is empty.
    pub fn parse(list: &[String]) -> Result<Self, Failure> {
        if list.is_empty() {
            return Ok(Self::ALL);
        }
        let mut asked = Self::NONE;
        for name in list {
            match name.trim() {
                "direct" => asked.direct = true,
                "specular" => asked.specular = true,
                "indirect" => asked.indirect = true,
                "total" => asked.total = true,
                other => {
                    return Err(Failure::Usage(format!(
                        "'{other}' is not a component; they are direct, specular, indirect and total"
                    )));
                }
            }
        }
        Ok(asked)
    }

    /// The components asked for.
    fn parts(self) -> impl Iterator<Item = Part> {
        let all: [(bool, Part); 4] = [
            (self.direct, ("direct", |l| l.direct)),
            (self.specular, ("specular", |l| l.specular)),
            (self.indirect, ("indirect", |l| l.indirect)),
            (self.total, ("total", ProbeLight::total)),
        ];
        all.into_iter().filter(|(asked, _)| *asked).map(|(_, part)| part)
    }

    /// The names of the columns that are added.
    pub fn columns(self) -> Vec<String> {
        let mut names = Vec::new();
        for (name, _) in self.parts() {
            names.extend(["r", "g", "b"].map(|channel| format!("{name}_{channel}")));
        }
        names.push("error".into());
        names
    }

    /// Refuses carried columns that would get the name of an array of the result.
    pub fn check_arrays(self, points: &Points) -> Result<(), Failure> {
        let taken = |name: &String| {
            ["position", "normal", "error"].contains(&name.as_str())
                || self.parts().any(|(part, _)| part == name)
        };
        match points.columns.iter().find(|name| taken(name)) {
            None => Ok(()),
            Some(clash) => Err(Failure::Input(format!(
                "the table has a column '{clash}', and the .npz file an array of that name; rename the \
                 column, or write .csv"
            ))),
        }
    }
}

/// The result, ready to be written.
pub struct Table<'a> {
    pub points: &'a Points,
    /// By row; none if there was no time.
    pub lights: &'a [Option<ProbeLight>],
    pub asked: Asked,
    /// From W to the unit asked for.
    pub factor: f64,
}

impl Table<'_> {
    /// What is added to a row: the components asked for, then the error.
    fn values(&self, light: Option<&ProbeLight>) -> Vec<f64> {
        let mut values = Vec::with_capacity(13);
        for (_, part) in self.asked.parts() {
            values.extend(light.map_or([f64::NAN; 3], |l| part(l).0.map(|x| x * self.factor)));
        }
        values.push(light.map_or(f64::INFINITY, |l| l.error * self.factor));
        values
    }

    /// As comma-separated values.
    pub fn csv(&self) -> String {
        let results = self.asked.columns();
        let names = self.points.columns.iter().chain(&results).map(|c| csv_field(c));
        let mut text = names.collect::<Vec<_>>().join(",") + "\n";
        for (row, light) in self.points.rows.iter().zip(self.lights) {
            for field in row {
                text += &csv_field(field);
                text.push(',');
            }
            let values = self.values(light.as_ref()).into_iter().map(csv_number);
            text += &values.collect::<Vec<_>>().join(",");
            text.push('\n');
        }
        text
    }

    /// As NumPy's arrays.
    pub fn npz(&self) -> Result<Vec<u8>, Failure> {
        let n = self.lights.len();
        let triples = |name: &str, values: Vec<f64>| Array {
            name: name.into(),
            shape: vec![n, 3],
            data: ArrayData::F64(values),
        };
        let receivers = &self.points.receivers;
        let mut arrays = vec![
            triples(
                "position",
                receivers.iter().flat_map(|r| [r.position.x, r.position.y, r.position.z]).collect(),
            ),
            triples(
                "normal",
                receivers.iter().flat_map(|r| [r.normal.x, r.normal.y, r.normal.z]).collect(),
            ),
        ];
        let values: Vec<Vec<f64>> = self.lights.iter().map(|l| self.values(l.as_ref())).collect();
        let mut at = 0;
        for (name, _) in self.asked.parts() {
            let part = values.iter().flat_map(|v| v[at..at + 3].iter().copied()).collect();
            arrays.push(triples(name, part));
            at += 3;
        }
        arrays.push(Array {
            name: "error".into(),
            shape: vec![n],
            data: ArrayData::F64(values.iter().map(|v| v[at]).collect()),
        });
        for (i, name) in self.points.columns.iter().enumerate() {
            if !COLUMNS.contains(&name.as_str()) {
                let column = self.points.rows.iter().map(|row| row[i].clone()).collect();
                arrays.push(carried(name, column));
            }
        }
        Ok(encode_npz(&arrays)?)
    }
}

/// A carried column: numbers if every field is one, else text.
fn carried(name: &str, column: Vec<String>) -> Array {
    let numbers: Option<Vec<f64>> = column.iter().map(|f| f.trim().parse().ok()).collect();
    Array {
        name: name.into(),
        shape: vec![column.len()],
        data: numbers.map_or(ArrayData::Text(column), ArrayData::F64),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn component_lists() {
        let list = |s: &str| Asked::parse(&s.split(',').map(String::from).collect::<Vec<_>>());
        assert_eq!(list("specular").unwrap(), Asked { specular: true, ..Asked::NONE });
        assert_eq!(Asked::parse(&[]).unwrap(), Asked::ALL);
        let two = list("total, direct").unwrap();
        assert_eq!(
            two.columns().join(" "),
            "direct_r direct_g direct_b total_r total_g total_b error"
        );
        for wrong in ["diffuse", "direct,", ""] {
            assert!(matches!(list(wrong), Err(Failure::Usage(_))), "{wrong}");
        }
    }

    #[test]
    fn carried_columns_are_numbers_or_text() {
        let column = |fields: [&str; 2]| fields.map(String::from).to_vec();
        assert!(
            matches!(carried("a", column(["1", " 2.5"])).data, ArrayData::F64(v) if v == [1.0, 2.5])
        );
        assert!(matches!(carried("a", column(["1", "desk"])).data, ArrayData::Text(_)));
    }
}
