//! Spellings of units: `g C m-2 month-1`, `mmol/(m^2 d)`, `kg m**-2 s**-1`, `µatm`, `degC` and their like.
//!
//! Words beside each other are multiplied; `/` divides by the next word or bracket, as in UDUNITS (`a/b c` is `a/b*c`).

use super::symbol::look_up;
use super::{Dimension, Substance, TOO_HIGH, Unit, usable};

/// Longest spelling that is read, bytes.
const MAX_UNIT_BYTES: usize = 100;
/// Highest power of a word.
const MAX_POWER: i8 = 9;
/// Deepest brackets.
const MAX_DEPTH: u32 = 4;

/// Reads a spelling; the error says which word is not known. What is in capitals only is read in small letters if it is no
/// unit otherwise: `M/S`, `G/KG`.
pub(crate) fn parse(text: &str) -> Result<Unit, String> {
    let read = spelled(text);
    if read.is_err() && !text.chars().any(char::is_lowercase) {
        return spelled(&text.to_lowercase()).or(read);
    }
    read
}

fn spelled(text: &str) -> Result<Unit, String> {
    if text.len() > MAX_UNIT_BYTES {
        return Err(format!(
            "is longer than {MAX_UNIT_BYTES} bytes; give a unit in a profile"
        ));
    }
    let plain = plain_spelling(text);
    if let Some(unit) = look_up(plain.trim()) {
        return Ok(unit);
    }
    if plain.trim().is_empty() {
        return Err("is empty; give a unit in a profile".to_owned());
    }
    let tokens = tokens(&plain)?;
    let mut parser = Parser {
        tokens: &tokens,
        at: 0,
    };
    let unit = parser.product(0)?;
    if parser.at == tokens.len() {
        Ok(unit)
    } else {
        Err(unknown(&format!("{:?}", tokens[parser.at])))
    }
}

fn unknown(word: &str) -> String {
    format!("has the unknown word {word}; give a unit such as \"mol m-2 s-1\" in a profile")
}

/// One spelling for each of the things people write in several ways.
fn plain_spelling(text: &str) -> String {
    let mut plain = text.trim_end_matches(['\0', '.']).replace("**", "^");
    for (from, to) in [
        ("µ", "u"),
        ("μ", "u"),
        ("⁻", "-"),
        ("⁰", "0"),
        ("¹", "1"),
        ("²", "2"),
        ("³", "3"),
        ("·", " "),
        ("−", "-"),
    ] {
        plain = plain.replace(from, to);
    }
    // An explanation behind the unit, as in "uatm (micro atmospheres)".
    match plain.find(" (") {
        Some(at)
            if plain[at..].chars().any(char::is_alphabetic)
                && plain.ends_with(')')
                && !plain[..at].trim_end().ends_with('/')
                && !is_scale(&plain[..at]) =>
        {
            plain[..at].to_owned()
        }
        _ => plain,
    }
}

/// Is it a number of something, as in "10^-6 (mol m-2)", and no unit that may be explained? The 1 of a plain number may.
fn is_scale(text: &str) -> bool {
    let is_number = |token: &Token| matches!(token, Token::Number(_) | Token::Power(_));
    let is_one = matches!(text.trim().parse::<f64>(), Ok(1.0));
    !is_one && tokens(text).is_ok_and(|tokens| tokens.iter().all(is_number))
}

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Word(String),
    Power(i8),
    Number(f64),
    Divide,
    Open,
    Close,
}

fn tokens(text: &str) -> Result<Vec<Token>, String> {
    let chars: Vec<char> = text.chars().collect();
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < chars.len() {
        let c = chars[at];
        let start = at;
        at += 1;
        // Right behind a word or a number digits are its power.
        let is_apart = start == 0 || matches!(chars[start - 1], ' ' | '*' | '.' | '/' | '(' | '\t');
        match c {
            '0'..='9' | '.' | '+' if is_apart && number_len(&chars[start..]) > 0 => {
                at = start + number_len(&chars[start..]);
                let digits: String = chars[start..at].iter().collect();
                tokens.push(number_or_power(&digits, false)?);
            }
            ' ' | '*' | '.' | '\t' => {}
            '/' => tokens.push(Token::Divide),
            '(' => tokens.push(Token::Open),
            ')' => tokens.push(Token::Close),
            '^' | '-' | '+' | '0'..='9' => {
                while at < chars.len()
                    && (chars[at].is_ascii_digit()
                        || at == start + 1 && matches!(chars[at], '-' | '+'))
                {
                    at += 1;
                }
                let digits: String = chars[start..at].iter().filter(|c| **c != '^').collect();
                tokens.push(number_or_power(&digits, c == '^' || c == '-' || !is_apart)?);
            }
            _ if is_letter(c) => {
                while at < chars.len() && is_letter(chars[at]) {
                    at += 1;
                }
                push_words(chars[start..at].iter().collect(), &mut tokens);
            }
            other => return Err(unknown(&format!("{other:?}"))),
        }
    }
    Ok(tokens)
}

/// Characters of the decimal number that begins here, as in `2`, `2.5`, `.5`, `1e-3` and `1.E-03`; none if none does. A point behind
/// which no digit follows, as in `10.m`, is none of its own.
fn number_len(chars: &[char]) -> usize {
    let digits = |from: usize| {
        let rest = chars.get(from..).unwrap_or_default();
        rest.iter().take_while(|c| c.is_ascii_digit()).count()
    };
    let is_at = |at: usize, these: [char; 2]| chars.get(at).is_some_and(|c| these.contains(c));
    let exponent = |at: usize| {
        if !is_at(at, ['e', 'E']) {
            return 0;
        }
        let sign = usize::from(is_at(at + 1, ['+', '-']));
        match digits(at + 1 + sign) {
            0 => 0,
            count => 1 + sign + count,
        }
    };
    let first = usize::from(chars.first() == Some(&'+'));
    let whole = digits(first);
    let mut end = first + whole;
    if chars.get(end) == Some(&'.') {
        let parts = digits(end + 1);
        if parts > 0 || whole > 0 && exponent(end + 1) > 0 {
            end += 1 + parts;
        }
    }
    if end == first {
        return 0;
    }
    end + exponent(end)
}

fn is_letter(c: char) -> bool {
    c.is_alphabetic() || matches!(c, '_' | '%' | '°')
}

fn number_or_power(digits: &str, is_power: bool) -> Result<Token, String> {
    let bad = || unknown(&format!("{digits:?}"));
    if is_power {
        let power: i8 = digits.parse().map_err(|_no_number| bad())?;
        return if (-MAX_POWER..=MAX_POWER).contains(&power) {
            Ok(Token::Power(power))
        } else {
            Err(bad())
        };
    }
    Ok(Token::Number(digits.parse().map_err(|_no_number| bad())?))
}

/// Splits the carbon off `gC`, `molC`, `gCO2`; the `2` of CO2 comes later as a power and is dropped there.
fn push_words(word: String, tokens: &mut Vec<Token>) {
    for label in ["CO", "C"] {
        if let Some(unit) = word.strip_suffix(label)
            && !unit.is_empty()
            && look_up(&word).is_none()
            && look_up(unit).is_some_and(|u| is_mass_or_amount(u.dimension))
        {
            tokens.push(Token::Word(unit.to_owned()));
            tokens.push(Token::Word(label.to_owned()));
            return;
        }
    }
    tokens.push(Token::Word(word));
}

fn is_mass_or_amount(dimension: Dimension) -> bool {
    matches!((dimension.mass, dimension.amount), (1, 0) | (0, 1))
}

struct Parser<'a> {
    tokens: &'a [Token],
    at: usize,
}

impl Parser<'_> {
    fn product(&mut self, depth: u32) -> Result<Unit, String> {
        if depth > MAX_DEPTH {
            return Err("has brackets too deep".to_owned());
        }
        let mut total = Unit {
            dimension: Dimension::default(),
            factor: 1.0,
            offset: 0.0,
            substance: None,
        };
        let mut divide = false;
        while let Some(token) = self.tokens.get(self.at) {
            self.at += 1;
            let part = match token {
                Token::Close if depth > 0 => return Ok(total),
                Token::Divide if !divide => {
                    divide = true;
                    continue;
                }
                Token::Open => self.product(depth + 1)?,
                Token::Number(number) => Unit {
                    factor: *number,
                    ..ONE
                },
                Token::Word(word) => match self.substance(word) {
                    Some(substance) => {
                        total.substance = Some(substance);
                        continue;
                    }
                    None => look_up(word).ok_or_else(|| unknown(&format!("{word:?}")))?,
                },
                Token::Power(_) | Token::Close | Token::Divide => {
                    return Err("is not spelt as a unit; give one in a profile".to_owned());
                }
            };
            let power = self.power();
            // No power of a word is past MAX_POWER, so that each has its negative.
            let power = if divide { -power } else { power };
            divide = false;
            total = times(total, part, power)?;
        }
        if depth > 0 || divide {
            Err("ends too early; give a unit in a profile".to_owned())
        } else {
            Ok(total)
        }
    }

    /// A word that says of what the mass or amount before it is.
    fn substance(&mut self, word: &str) -> Option<Substance> {
        match word {
            "C" | "carbon" => Some(Substance::Carbon),
            "CO" => {
                self.at += usize::from(self.tokens.get(self.at) == Some(&Token::Power(2)));
                Some(Substance::Co2)
            }
            _ => None,
        }
    }

    fn power(&mut self) -> i8 {
        match self.tokens.get(self.at) {
            Some(Token::Power(power)) => {
                self.at += 1;
                *power
            }
            _ => 1,
        }
    }
}

const ONE: Unit = Unit {
    dimension: Dimension {
        mass: 0,
        length: 0,
        time: 0,
        month: 0,
        temperature: 0,
        amount: 0,
    },
    factor: 1.0,
    offset: 0.0,
    substance: None,
};

fn times(total: Unit, part: Unit, power: i8) -> Result<Unit, String> {
    let raise = |a: i8, b: i8| a.checked_add(b.checked_mul(power)?);
    let (a, b) = (total.dimension, part.dimension);
    let dimension = (|| {
        Some(Dimension {
            mass: raise(a.mass, b.mass)?,
            length: raise(a.length, b.length)?,
            time: raise(a.time, b.time)?,
            month: raise(a.month, b.month)?,
            temperature: raise(a.temperature, b.temperature)?,
            amount: raise(a.amount, b.amount)?,
        })
    })();
    let factor = total.factor * part.factor.powi(power.into());
    // Inside a product a degree Celsius is a difference of temperature: the offset falls away. A number of them is a scale of its own,
    // from the same zero, as in UDUNITS: `0.01 degC`.
    let is_scale = power == 1 && a == Dimension::default() && total.substance.is_none();
    Ok(Unit {
        dimension: dimension.ok_or(TOO_HIGH)?,
        factor: usable(factor)?,
        offset: if is_scale { part.offset } else { 0.0 },
        substance: total.substance.or(part.substance),
    })
}
