//! Enums whose variants have names on command lines and in files.

/// Declares an enum whose variants have names, with `ALL`, `name`,
/// [`Display`](std::fmt::Display) and [`FromStr`](std::str::FromStr), whose error
/// lists the names. In that error, the literal after the enum is the kind of the
/// names.
#[macro_export]
macro_rules! named {
    (
        $(#[$meta:meta])*
        pub enum $name:ident: $what:literal {
            $($(#[$variant_meta:meta])* $variant:ident = $word:literal,)+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $name {
            $($(#[$variant_meta])* $variant,)+
        }

        impl $name {
            /// All variants, in order.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$variant),+];

            /// Its name on command lines and in files.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }
        }

        impl ::std::fmt::Display for $name {
            fn fmt(&self, f: &mut ::std::fmt::Formatter<'_>) -> ::std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl ::std::str::FromStr for $name {
            type Err = $crate::FormatError;

            fn from_str(word: &str) -> Result<Self, $crate::FormatError> {
                Self::ALL.into_iter().find(|one| one.name() == word).ok_or_else(|| {
                    $crate::FormatError::UnknownName {
                        word: word.to_owned(),
                        what: $what,
                        choices: Self::ALL.map(Self::name).join(", "),
                    }
                })
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use crate::Attribute;

    #[test]
    fn every_variant_is_found_by_its_name_and_other_words_are_refused() {
        for attribute in Attribute::ALL {
            assert_eq!(attribute.to_string().parse::<Attribute>().unwrap(), attribute);
        }
        assert_eq!(format!("[{:>6}]", Attribute::Ring), "[  ring]");
        let error = "colour".parse::<Attribute>().unwrap_err().to_string();
        let expected = "unknown attribute `colour`, expected one of range, beam, ring, time,";
        assert!(error.starts_with(expected), "{error}");
    }
}
