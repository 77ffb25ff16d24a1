//! Small NetCDF classic files of any variables and attributes, written by the crate netcdf3.

use std::path::Path;

use netcdf3::{DataSet, FileWriter, Version};

/// The value of an attribute.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Says {
    Text(&'static str),
    Bytes(&'static [i8]),
    Shorts(&'static [i16]),
    Floats(&'static [f32]),
    Doubles(&'static [f64]),
}

/// The values of a variable.
#[derive(Debug, Clone)]
pub(crate) enum Values {
    Bytes(Vec<i8>),
    Shorts(Vec<i16>),
    Ints(Vec<i32>),
    Floats(Vec<f32>),
    Doubles(Vec<f64>),
}

/// One variable.
#[derive(Debug, Clone)]
pub(crate) struct Made {
    pub(crate) name: &'static str,
    pub(crate) dimensions: Vec<&'static str>,
    pub(crate) attributes: Vec<(&'static str, Says)>,
    pub(crate) values: Values,
}

impl Made {
    pub(crate) fn new(name: &'static str, dimensions: &[&'static str], values: Values) -> Self {
        Self {
            name,
            dimensions: dimensions.to_vec(),
            attributes: vec![],
            values,
        }
    }

    /// With an attribute, instead of one of that name that it has.
    pub(crate) fn says(mut self, name: &'static str, says: Says) -> Self {
        self.attributes.retain(|(own, _)| *own != name);
        self.attributes.push((name, says));
        self
    }

    pub(crate) fn text(self, name: &'static str, text: &'static str) -> Self {
        self.says(name, Says::Text(text))
    }
}

/// A file.
#[derive(Debug, Clone, Default)]
pub(crate) struct MadeFile {
    pub(crate) attributes: Vec<(&'static str, &'static str)>,
    pub(crate) dimensions: Vec<(&'static str, usize)>,
    pub(crate) variables: Vec<Made>,
}

impl MadeFile {
    /// A map of 4 x 8 cells of 45 degrees, north first, with degrees as units, and `count` days from 2001-01-01 on at midnight.
    pub(crate) fn days(count: usize) -> Self {
        let lat = Values::Doubles(vec![67.5, 22.5, -22.5, -67.5]);
        let lon = Values::Doubles((0..8).map(|i| -157.5 + 45.0 * f64::from(i)).collect());
        let time = Values::Doubles((0..count).map(|day| day as f64).collect());
        Self {
            attributes: vec![],
            dimensions: vec![("time", count), ("lat", 4), ("lon", 8), ("two", 2)],
            variables: vec![
                Made::new("lat", &["lat"], lat).text("units", "degrees_north"),
                Made::new("lon", &["lon"], lon).text("units", "degrees_east"),
                Made::new("time", &["time"], time).text("units", "days since 2001-01-01"),
            ],
        }
    }

    /// Also with a temperature of 20 degrees Celsius everywhere.
    pub(crate) fn sst(count: usize) -> Self {
        let sst = Made::new(
            "sst",
            &["time", "lat", "lon"],
            Values::Floats(vec![20.0; 32 * count]),
        );
        let sst = sst
            .text("standard_name", "sea_surface_temperature")
            .text("units", "degC");
        Self::days(count).with(sst)
    }

    /// With a variable, instead of one of that name that it has.
    pub(crate) fn with(mut self, variable: Made) -> Self {
        self.variables.retain(|own| own.name != variable.name);
        self.variables.push(variable);
        self
    }

    /// With an attribute of the file.
    pub(crate) fn text(mut self, name: &'static str, text: &'static str) -> Self {
        self.attributes.push((name, text));
        self
    }

    /// With one variable changed.
    pub(crate) fn but(mut self, name: &str, change: impl FnOnce(Made) -> Made) -> Self {
        let place = self.variables.iter().position(|v| v.name == name).unwrap();
        let variable = self.variables.remove(place);
        self.variables.insert(place, change(variable));
        self
    }

    /// With other numbers in a variable of doubles.
    pub(crate) fn numbers(self, name: &str, numbers: &[f64]) -> Self {
        let numbers = Values::Doubles(numbers.to_vec());
        self.but(name, |v| Made {
            values: numbers,
            ..v
        })
    }

    pub(crate) fn write(&self, path: &Path) {
        let mut set = DataSet::new();
        for (name, text) in &self.attributes {
            set.add_global_attr_string(name, text).unwrap();
        }
        for (name, len) in &self.dimensions {
            set.add_fixed_dim(name, *len).unwrap();
        }
        for variable in &self.variables {
            define(&mut set, variable);
        }
        let mut writer = FileWriter::open(path).unwrap();
        writer.set_def(&set, Version::Classic, 0).unwrap();
        for Made { name, values, .. } in &self.variables {
            match values {
                Values::Bytes(values) => writer.write_var_i8(name, values),
                Values::Shorts(values) => writer.write_var_i16(name, values),
                Values::Ints(values) => writer.write_var_i32(name, values),
                Values::Floats(values) => writer.write_var_f32(name, values),
                Values::Doubles(values) => writer.write_var_f64(name, values),
            }
            .unwrap();
        }
        writer.close().unwrap();
    }
}

fn define(set: &mut DataSet, variable: &Made) {
    let Made {
        name,
        dimensions,
        attributes,
        values,
    } = variable;
    match values {
        Values::Bytes(_) => set.add_var_i8(name, dimensions),
        Values::Shorts(_) => set.add_var_i16(name, dimensions),
        Values::Ints(_) => set.add_var_i32(name, dimensions),
        Values::Floats(_) => set.add_var_f32(name, dimensions),
        Values::Doubles(_) => set.add_var_f64(name, dimensions),
    }
    .unwrap();
    for (attribute, says) in attributes {
        match says {
            Says::Text(text) => set.add_var_attr_string(name, attribute, text),
            Says::Bytes(numbers) => set.add_var_attr_i8(name, attribute, numbers.to_vec()),
            Says::Shorts(numbers) => set.add_var_attr_i16(name, attribute, numbers.to_vec()),
            Says::Floats(numbers) => set.add_var_attr_f32(name, attribute, numbers.to_vec()),
            Says::Doubles(numbers) => set.add_var_attr_f64(name, attribute, numbers.to_vec()),
        }
        .unwrap();
    }
}
