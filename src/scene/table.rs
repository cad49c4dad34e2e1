//! TOML tables whose errors name the key and the line: of scene files, and of the other files that users write.

use std::path::Path;

use glam::Vec3;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Error, Place, nearest, quote, read_bytes};

/// The text of a file of at most `longest` bytes.
pub(crate) fn read_text(path: &Path, longest: u64) -> Result<String, Error> {
    String::from_utf8(read_bytes(path, None, longest)?).map_err(|error| {
        let line =
            error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|byte| **byte == b'\n').count() + 1;
        Error::unexpected(Place::line(path, line), "bytes that are not UTF-8", "TOML text")
    })
}

/// A file of TOML text.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub file: &'a Path,
    pub text: &'a str,
}

/// A table in it.
#[derive(Clone)]
pub(crate) struct Table<'a> {
    source: Source<'a>,
    name: String,
    offset: usize,
    entries: &'a DeTable<'a>,
}

/// A value in it.
#[derive(Clone)]
pub(crate) struct Value<'a> {
    source: Source<'a>,
    field: String,
    value: &'a Spanned<DeValue<'a>>,
}

impl<'a> Source<'a> {
    /// Parses the text.
    pub fn parse(self) -> Result<Spanned<DeTable<'a>>, Error> {
        DeTable::parse(self.text).map_err(|error| {
            let place = self.place(error.span().map_or(0, |span| span.start), None);
            Error::unexpected(place, format!("broken TOML ({})", error.message().replace('\n', ", ")), "TOML 1.0")
        })
    }

    fn place(self, offset: usize, field: Option<String>) -> Place {
        let newlines = self.text.bytes().take(offset).filter(|byte| *byte == b'\n').count();
        Place { file: self.file.to_owned(), line: Some(newlines + 1), field }
    }
}

impl<'a> Table<'a> {
    pub fn root(source: Source<'a>, entries: &'a Spanned<DeTable<'a>>) -> Table<'a> {
        Table { source, name: String::new(), offset: 0, entries: entries.get_ref() }
    }

    /// Refuses keys that are not among the known ones.
    pub fn allow(&self, known: &[&str]) -> Result<(), Error> {
        for key in self.entries.keys() {
            let name: &str = key.get_ref();
            if !known.contains(&name) {
                let field = if self.name.is_empty() { None } else { Some(self.name.clone()) };
                let place = self.source.place(key.span().start, field);
                let nearest = nearest(name, known.iter().copied()).to_owned();
                return Err(Error::UnknownKey { place, key: name.to_owned(), nearest });
            }
        }
        Ok(())
    }

    pub fn get(&self, key: &str) -> Option<Value<'a>> {
        let (_, value) = self.entries.iter().find(|(name, _)| name.get_ref() == key)?;
        Some(self.value(key, value))
    }

    pub fn require(&self, key: &str) -> Result<Value<'a>, Error> {
        self.get(key).ok_or_else(|| self.error("nothing", format!("the key `{key}`")))
    }

    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    /// The keys with their values, in alphabetical order.
    pub fn iter(&self) -> impl Iterator<Item = (&'a str, Value<'a>)> + '_ {
        self.entries.iter().map(|(key, value)| {
            let key: &'a str = key.get_ref();
            (key, self.value(key, value))
        })
    }

    pub fn place(&self) -> Place {
        let field = if self.name.is_empty() { None } else { Some(self.name.clone()) };
        self.source.place(self.offset, field)
    }

    pub fn error(&self, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::unexpected(self.place(), found, expected)
    }

    fn value(&self, key: &str, value: &'a Spanned<DeValue<'a>>) -> Value<'a> {
        let field = if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) };
        Value { source: self.source, field, value }
    }
}

impl<'a> Value<'a> {
    pub fn place(&self) -> Place {
        self.source.place(self.value.span().start, Some(self.field.clone()))
    }

    /// The error that something else stands here.
    pub fn error(&self, expected: impl Into<String>) -> Error {
        let span = self.value.span();
        let found = match self.value.get_ref() {
            DeValue::Table(_) => "a table".to_owned(),
            DeValue::Array(_) if self.source.text[span.clone()].contains('\n') => "an array".to_owned(),
            _ => quote(&self.source.text[span]),
        };
        Error::unexpected(self.place(), found, expected)
    }

    fn as_f32(&self) -> Option<f32> {
        let number = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse::<f64>().ok()?,
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix()).ok()? as f64,
            _ => return None,
        };
        let number = number as f32;
        number.is_finite().then_some(number)
    }

    /// A finite number between two bounds, both included.
    pub fn number(&self, least: f32, most: f32) -> Result<f32, Error> {
        self.as_f32().filter(|number| (least..=most).contains(number)).ok_or_else(|| {
            self.error(match (least, most) {
                (f32::MIN, f32::MAX) => "a finite number".to_owned(),
                (f32::MIN_POSITIVE, f32::MAX) => "a number above 0".to_owned(),
                (_, 1e6..) => format!("a number from {least} to {most:e}"),
                _ => format!("a number from {least} to {most}"),
            })
        })
    }

    /// A whole number between two bounds, both included.
    pub fn integer(&self, least: u32, most: u32) -> Result<u32, Error> {
        let number = match self.value.get_ref() {
            DeValue::Integer(integer) => u32::from_str_radix(integer.as_str(), integer.radix()).ok(),
            _ => None,
        };
        let within = number.filter(|number| (least..=most).contains(number));
        within.ok_or_else(|| self.error(format!("a whole number from {least} to {most}")))
    }

    pub fn boolean(&self) -> Result<bool, Error> {
        self.value.get_ref().as_bool().ok_or_else(|| self.error("true or false"))
    }

    pub fn string(&self) -> Result<&'a str, Error> {
        self.value.get_ref().as_str().ok_or_else(|| self.error("a string"))
    }

    pub fn array(&self) -> Result<Vec<Value<'a>>, Error> {
        let items = self.value.get_ref().as_array().ok_or_else(|| self.error("an array"))?;
        let item = |(i, value)| Value { source: self.source, field: format!("{}[{i}]", self.field), value };
        Ok(items.iter().enumerate().map(item).collect())
    }

    pub fn table(&self) -> Result<Table<'a>, Error> {
        let entries = self.value.get_ref().as_table().ok_or_else(|| self.error("a table"))?;
        Ok(Table { source: self.source, name: self.field.clone(), offset: self.value.span().start, entries })
    }

    pub fn is_array(&self) -> bool {
        self.value.get_ref().is_array()
    }

    /// An array of N numbers between two bounds.
    pub fn numbers<const N: usize>(&self, least: f32, most: f32) -> Result<[f32; N], Error> {
        let wrong = || self.error(format!("an array of {N} numbers"));
        let items = self.array().map_err(|_| wrong())?;
        let numbers = items.iter().map(|item| item.number(least, most)).collect::<Result<Vec<_>, _>>()?;
        numbers.try_into().map_err(|_| wrong())
    }

    /// A point or a vector, each coordinate at most `most` in magnitude.
    pub fn vector(&self, most: f32) -> Result<Vec3, Error> {
        self.numbers(-most, most).map(Vec3::from_array)
    }

    /// One number for all channels, or three.
    pub fn color(&self, least: f32, most: f32) -> Result<Vec3, Error> {
        if self.is_array() {
            self.numbers(least, most).map(Vec3::from_array)
        } else {
            self.number(least, most).map(Vec3::splat)
        }
    }
}
