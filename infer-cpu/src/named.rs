//! Enums whose variants have names on command lines.

/// Declares an enum with `ALL` of its variants, their `name`s, and the way back.
/// The word after its name tells readers of an error what the names are for.
macro_rules! named {
    (
        $(#[$meta:meta])*
        pub enum $name:ident: $what:literal {
            $($(#[$variant_meta:meta])* $variant:ident = $word:literal,)+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $name {
            $($(#[$variant_meta])* $variant,)+
        }

        impl $name {
            /// All of them.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$variant),+];

            /// Its name on command lines.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $name {
            type Err = formats::FormatError;

            fn from_str(word: &str) -> Result<Self, formats::FormatError> {
                Self::ALL.into_iter().find(|one| one.name() == word).ok_or_else(|| {
                    formats::FormatError::UnknownName {
                        word: word.to_owned(),
                        what: $what,
                        choices: Self::ALL.map(Self::name).join(", "),
                    }
                })
            }
        }
    };
}
pub(crate) use named;
