# Numbers of lmerTest that test_mixed_model.py compares with.
# The data, mixed_model_oracle.csv, are made up: four small layouts of pulses in trials.
# Run in this folder: Rscript mixed_model_oracle.R  (writes mixed_model_oracle.json)
# Made with R 4.2.2, lme4 1.1-31, lmerTest 3.1-3.
suppressPackageStartupMessages(library(lmerTest))
data <- read.csv("mixed_model_oracle.csv")
tight <- lmerControl(
  optimizer = "nloptwrap",
  optCtrl = list(xtol_abs = 1e-12, ftol_abs = 1e-14, xtol_rel = 1e-12, ftol_rel = 1e-14),
  check.conv.singular = "ignore"
)
number <- function(x) paste0("[", paste(sprintf("%.15g", x), collapse = ", "), "]")
entries <- sapply(unique(data$set), function(name) {
  rows <- data[data$set == name, ]
  fit <- lmer(y ~ type * direction + (1 | trial), rows, REML = TRUE, control = tight)
  variances <- as.data.frame(VarCorr(fit))$vcov
  single <- sapply(2:4, function(k) unlist(contestMD(fit, diag(4)[k, , drop = FALSE])[3:6]))
  joint <- unlist(contestMD(fit, diag(4)[2:4, ])[3:6])
  paste0(
    '  "', name, '": {\n',
    '    "beta": ', number(fixef(fit)), ',\n',
    '    "se": ', number(sqrt(diag(as.matrix(vcov(fit))))), ',\n',
    '    "variances": ', number(variances), ',\n',
    '    "df_den": ', number(single["DenDF", ]), ',\n',
    '    "f": ', number(single["F value", ]), ',\n',
    '    "p": ', number(single["Pr(>F)", ]), ',\n',
    '    "joint": ', number(joint), '\n  }'
  )
})
writeLines(c("{", paste(entries, collapse = ",\n"), "}"), "mixed_model_oracle.json")
