# What metafor (GPL-3) and lme4 (GPL-2) make of people in people_reference.json; that file is its output.
#   Rscript make_people_reference.R > people_reference.json     (Debian: r-cran-metafor, r-cran-lme4)
suppressMessages({library(metafor); library(lme4)})

number <- function(x) paste0("[", paste(sprintf("%.12g", x), collapse = ", "), "]")
object <- function(parts) paste0("{", paste0('"', names(parts), '": ', unlist(parts), collapse = ", "), "}")

set.seed(5)
people <- 9; points <- 3
rows <- expand.grid(point = 1:points, kind = 1:2, person = 1:people)
level <- matrix(rnorm(2 * people), people) %*% chol(matrix(c(.09, .03, .03, .04), 2))
rows$error <- runif(nrow(rows), .04, .2)
rows$y <- 1 + .3 * rows$point - .5 * rows$kind + level[cbind(rows$person, rows$kind)] +
  c(.12, .15)[rows$kind] * rnorm(nrow(rows)) + rows$error * rnorm(nrow(rows))
rows$element <- factor((rows$kind - 1) * points + rows$point)
rows$kind <- factor(rows$kind)
rows$own <- factor(seq_len(nrow(rows)))
fit <- rma.mv(y, error^2, mods = ~ element - 1, random = list(~ kind | person, ~ kind | own),
  struct = c("UN", "DIAG"), data = rows, method = "REML", sparse = FALSE,
  control = list(optimizer = "optim", optmethod = "BFGS", reltol = 1e-14, maxit = 10000))
meta <- object(list(values = number(rows$y), errors = number(rows$error), mean = number(fit$beta),
  se = number(fit$se), level_sd = number(sqrt(fit$tau2)), correlation = number(fit$rho),
  place_sd = number(sqrt(fit$gamma2))))

one <- rows[rows$kind == 1, ]
sharp <- lmerControl(optimizer = "bobyqa", optCtrl = list(rhoend = 1e-10))
plain <- lmer(y ~ element - 1 + (1 | person), data = one, REML = TRUE, control = sharp)
sds <- as.data.frame(VarCorr(plain))$sdcor
mixed <- object(list(values = number(one$y), mean = number(fixef(plain)),
  se = number(sqrt(diag(as.matrix(vcov(plain))))), level_sd = number(sds[1]), place_sd = number(sds[2])))
cat(object(list(people = people, points = points, metafor = meta, lme4 = mixed)), "\n")
