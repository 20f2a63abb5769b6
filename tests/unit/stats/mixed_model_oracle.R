# Numbers of lme4, lmerTest, pbkrtest and emmeans that test_mixed_model.py compares with.
# The data, mixed_model_oracle.csv, are made up: small layouts, with and without replicates,
# missing cells, and variances at 0. With JOINTZ_DATA set, also the published table.
# Run in this folder: Rscript mixed_model_oracle.R [OUT.json]  (default mixed_model_oracle.json)
# Made with R 4.2.2, lme4 1.1-31, lmerTest 3.1-3, pbkrtest 0.5.2, emmeans 1.8.4-1.
suppressPackageStartupMessages({
  library(lmerTest)
  library(pbkrtest)
  library(emmeans)
})
out <- c(commandArgs(trailingOnly = TRUE), "mixed_model_oracle.json")[1]
emm_options(msg.interaction = FALSE, msg.nesting = FALSE)
tight <- lmerControl(
  optimizer = "nloptwrap",
  optCtrl = list(xtol_abs = 1e-12, ftol_abs = 1e-15, xtol_rel = 1e-12, ftol_rel = 1e-15,
                 maxeval = 10000),
  check.conv.singular = "ignore", check.conv.grad = "ignore", check.conv.hess = "ignore"
)
number <- function(x) {
  text <- ifelse(is.finite(x), sprintf("%.15g", x), "null")
  paste0("[", paste(text, collapse = ", "), "]")
}
object <- function(parts) {
  paste0("{", paste0('"', names(parts), '": ', unlist(parts), collapse = ",\n    "), "}")
}
columns <- function(table, names) object(sapply(names, function(n) number(table[[n]])))

one <- function(rows) {
  rows$level <- factor(rows$level, levels = unique(rows$level))
  rows$participant <- factor(rows$participant, levels = unique(rows$participant))
  # lme4's tolerances are absolute: fit at unit scale, about zero, and bring back.
  scale <- sd(rows$y)
  centre <- mean(rows$y)
  rows$y <- (rows$y - centre) / scale
  cells <- table(rows$participant, rows$level)
  nested <- any(cells > 1)
  formula <- if (nested) y ~ level + (1 | participant) + (1 | participant:level)
             else y ~ level + (1 | participant)
  fit <- lmer(formula, rows, REML = TRUE, control = tight)
  size <- as.data.frame(VarCorr(fit))
  variances <- scale^2 * size$vcov[match(c("participant", "participant:level", "Residual"), size$grp)]
  parts <- list(
    variances = number(variances[!is.na(variances)]),
    satterthwaite = number(unlist(anova(fit)[1, c("F value", "NumDF", "DenDF", "Pr(>F)")])),
    "kenward-roger" = number(unlist(anova(fit, ddf = "Kenward-Roger")[1,
      c("F value", "NumDF", "DenDF", "Pr(>F)")])),
    ranova = number(ranova(fit)$LRT[-1])
  )
  for (method in c("satterthwaite", "kenward-roger")) {
    means <- emmeans(fit, "level", lmer.df = method)
    shown <- as.data.frame(means)
    shown$emmean <- centre + scale * shown$emmean
    shown$SE <- scale * shown$SE
    shown$lower.CL <- centre + scale * shown$lower.CL
    shown$upper.CL <- centre + scale * shown$upper.CL
    parts[[paste0("means_", method)]] <-
      columns(shown, c("emmean", "SE", "df", "lower.CL", "upper.CL"))
    plain <- pairs(means, adjust = "none")
    table <- as.data.frame(plain)
    table$bonferroni <- as.data.frame(pairs(means, adjust = "bonferroni"))$p.value
    table$holm <- as.data.frame(pairs(means, adjust = "holm"))$p.value
    limits <- as.data.frame(confint(plain, adjust = "bonferroni"))
    for (name in c("estimate", "SE")) table[[name]] <- scale * table[[name]]
    table$low <- scale * limits$lower.CL
    table$high <- scale * limits$upper.CL
    parts[[paste0("pairs_", method)]] <- columns(table,
      c("estimate", "SE", "df", "t.ratio", "p.value", "bonferroni", "holm", "low", "high"))
  }
  if (length(unique(c(cells))) == 1) {
    Y <- tapply(rows$y, list(rows$participant, rows$level), mean)
    spherical <- anova(lm(Y ~ 1), X = ~1, test = "Spherical")
    parts$spherical <- number(c(spherical$F[1], spherical[1, "num Df"], spherical[1, "den Df"],
      spherical[1, "Pr(>F)"], spherical[1, "G-G Pr"]))
    error <- if (nested) summary(aov(y ~ level + participant + Error(participant:level), rows))
             else summary(aov(y ~ level + participant, rows))
    # summary() of strata: the participants are tested in the first that holds them.
    lines <- if (nested) error[[1]][[1]] else error[[1]]
    row <- grep("participant", rownames(lines))[1]
    parts$participants <- number(c(lines[row, "F value"], lines[row, "Df"],
      lines[nrow(lines), "Df"], lines[row, "Pr(>F)"]))
  }
  if (!nested) {
    wide <- tapply(rows$y, list(rows$participant, rows$level), mean)
    combos <- combn(ncol(wide), 2)
    t <- apply(combos, 2, function(k) {
      d <- na.omit(wide[, k[1]] - wide[, k[2]])
      if (length(d) < 2) return(rep(NA, 3))
      test <- t.test(d)
      c(test$statistic, test$parameter, test$p.value)
    })
    parts$paired <- object(list(t = number(t[1, ]), df = number(t[2, ]), p = number(t[3, ])))
    both <- anova(lm(y ~ level, rows), lm(y ~ level + participant, rows))
    parts$exact <- number(c(both$F[2], both$Df[2], both$Res.Df[2], both$`Pr(>F)`[2]))
  }
  paste0("  ", object(parts))
}

data <- read.csv("mixed_model_oracle.csv")
sets <- split(data, factor(data$set, levels = unique(data$set)))
published <- file.path(Sys.getenv("JOINTZ_DATA"), "dissertation", "knee_impedance_60.csv")
if (file.exists(published)) {
  printed <- read.csv(published)
  for (name in c("stiffness_Nm_per_rad_per_kg", "damping_Nms_per_rad_per_kg", "inertia_kgm2")) {
    sets[[paste0("published ", name)]] <- data.frame(
      participant = printed$subject, level = printed$timing_point, y = printed[[name]])
  }
}
entries <- sapply(names(sets), function(name) paste0('"', name, '":\n', one(sets[[name]])))
writeLines(c("{", paste(entries, collapse = ",\n"), "}"), out)
